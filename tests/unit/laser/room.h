#pragma once

#include <cstdint>
#include <vector>

#include "dataset/laser.h"
#include "geometry/polygon.h"

namespace omnifleet::test {

struct Disc {
  Eigen::Vector2d centre_m;
  double radius_m;
};

/// Polygons and discs around a scanner at the origin, with distances in closed form.
struct Room {
  std::vector<Polygon> polygons;
  std::vector<Disc> discs;

  /// Distance to the nearest surface; +inf if there is none.
  double distance(double bearing_rad) const;
  /// One full turn from −π, with Gaussian noise.
  dataset::LaserRow scan(int beams, double sigma_m = 0.0, std::uint32_t seed = 1) const;
};

Polygon box(const Eigen::Vector2d& centre_m, const Eigen::Vector2d& size_m, double angle_rad);

}  // namespace omnifleet::test
