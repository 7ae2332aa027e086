#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/map_files.h"

namespace omnifleet::evaluation {

/// Distance of a point from the surface of an upright prism, metres. Negative inside.
double surfaceDistance(const Polygon& footprint_m, double height_m, const Eigen::Vector3d& point_m);

/// Points (centres of voxels) compared with the solids of the scene.
struct SolidMetrics {
  int points = 0;
  double median_m = 0.0, share90_m = 0.0,
         max_m = 0.0;  ///< distance outside the nearest solid, metres
};

/// Objects of unknown height (≤ 0) in `scene` are ignored. NaN without points or without solids.
SolidMetrics compareSolids(const std::vector<dataset::MapObject>& scene,
                           const std::vector<Eigen::Vector3d>& points);

}  // namespace omnifleet::evaluation
