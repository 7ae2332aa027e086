#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/boundary.h"

namespace omnifleet::scan::testing {

/// Exact scans of polygons: the nearest intersection per bearing in closed form.
struct Scene {
  std::vector<Polygon> outlines;

  /// Range from a place along a unit vector, metres; 0 without an intersection.
  double range(const Eigen::Vector2d& from, const Eigen::Vector2d& along) const;
  /// @param sigma of the inverse range, 1/m: Gaussian noise of that size is added where it is positive
  Boundary scan(const Pose2& pose, double sigma, std::mt19937& random, int beams = 720) const;
};

/// 5 × 4 m with two cupboards at the walls and two free-standing boxes.
Scene furnishedRoom();
/// Two parallel walls, 1.6 m apart and 40 m long.
Scene corridor();

}  // namespace omnifleet::scan::testing
