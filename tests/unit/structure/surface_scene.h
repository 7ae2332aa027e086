#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "geometry/polygon.h"
#include "structure/surface_map.h"

namespace omnifleet::structure::testing {

/// A room with obstacles and the surface map that ideal range sensors make of it, in closed form. It shares
/// no code with libs/occupancy or libs/structure.
struct SurfaceScene {
  Polygon room;
  std::vector<Polygon> obstacles;
  std::vector<Eigen::Vector2d> viewpoints;

  /// A cell is occupied if a visible part of a face lies in it; its mean is the mean of that part. It is free
  /// if its centre is visible. `noise_m` is added to both coordinates of each mean.
  SurfaceMap map(double resolution_m = 0.05, double noise_m = 0.0, unsigned seed = 1) const;

 private:
  bool isVisible(const Eigen::Vector2d& point) const;
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> faces() const;
};

/// A rectangle, counter-clockwise, rotated about its centre.
Polygon rectangle(const Eigen::Vector2d& centre, double length_m, double width_m, double angle_rad = 0.0);

/// Makes all cells beyond x unknown.
void hideBeyond(SurfaceMap& map, double x_m);

/// A map from rows of text, the top row first: '.' free, '#' occupied with a ray end in its middle, 'o'
/// occupied without ray ends, ' ' unknown. Cells of 0.1 m, origin at zero.
SurfaceMap drawing(const std::vector<std::string>& rows);

}  // namespace omnifleet::structure::testing
