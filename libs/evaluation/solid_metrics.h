#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/map_files.h"

namespace omnifleet::evaluation {

/// Distance of a point from the surface of an upright prism, metres, negative inside.
double surfaceDistance(const Polygon& footprint_m, double height_m, const Eigen::Vector3d& point_m);

/// Points (voxels' middles) against solids that stand in the scene.
struct SolidMetrics {
  int points = 0;
  double median_m = 0.0, share90_m = 0.0,
         max_m = 0.0;  ///< how far they lie outside of the nearest solid, metres
};

/// `scene`: objects of unknown height (≤ 0) are left out. NaN where there are no points or no solids.
SolidMetrics compareSolids(const std::vector<dataset::MapObject>& scene,
                           const std::vector<Eigen::Vector3d>& points);

}  // namespace omnifleet::evaluation
