#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet {

/// A simple polygon: vertices in order, the last one not repeated. Counter-clockwise unless stated otherwise.
using Polygon = std::vector<Eigen::Vector2d>;

/// Signed area, positive for counter-clockwise order, in the square of the vertices' unit. 0 for fewer than 3
/// vertices.
double signedArea(const Polygon& polygon);

/// Area centroid, or the mean of the vertices if the area is zero. Zero for an empty polygon.
Eigen::Vector2d centroid(const Polygon& polygon);

/// True inside the polygon or on its border (even-odd rule).
bool contains(const Polygon& polygon, const Eigen::Vector2d& point);

/// Distance to the outline, metres. 0 inside the polygon.
double distanceTo(const Polygon& polygon, const Eigen::Vector2d& point);

/// Regular polygon, counter-clockwise. Its vertices lie on the circle.
Polygon circlePolygon(const Eigen::Vector2d& centre, double radius_m, int vertices);

}  // namespace omnifleet
