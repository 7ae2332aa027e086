#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet {

/// A simple polygon: vertices in order, the last one not repeated. Counter-clockwise unless said otherwise.
using Polygon = std::vector<Eigen::Vector2d>;

/// Signed area, positive for counter-clockwise order; square of the vertices' unit. 0 for fewer than 3
/// vertices.
double signedArea(const Polygon& polygon);

/// Area centroid; the mean of the vertices where the area vanishes. Undefined (zero) for an empty polygon.
Eigen::Vector2d centroid(const Polygon& polygon);

/// True inside or on the border (even-odd rule).
bool contains(const Polygon& polygon, const Eigen::Vector2d& point);

/// Metres to its outline; 0 inside.
double distanceTo(const Polygon& polygon, const Eigen::Vector2d& point);

/// Regular polygon around a centre, counter-clockwise; its vertices lie on the circle.
Polygon circlePolygon(const Eigen::Vector2d& centre, double radius_m, int vertices);

}  // namespace omnifleet
