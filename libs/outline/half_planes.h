#pragma once

#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// The points x with normal · x ≤ offset_m. `normal` need not be a unit vector.
struct HalfPlane {
  Eigen::Vector2d normal;
  double offset_m;
};

/// Intersection of half-planes within the square |x|, |y| ≤ bound_m; counter-clockwise, empty if the
/// half-planes share no area. Plain clipping in doubles: an n log n method does not pay for the 48–96
/// directions of a support function.
Polygon intersectHalfPlanes(const std::vector<HalfPlane>& planes, double bound_m = 1e3);

/// `polygon` (convex, counter-clockwise) clipped by one half-plane.
Polygon clip(const Polygon& polygon, const HalfPlane& plane);

/// Area shared by two convex counter-clockwise polygons, in doubles (microseconds, no exact arithmetic).
double convexIntersectionArea(const Polygon& a, const Polygon& b);
/// Intersection over union of two convex counter-clockwise polygons; 0 if either has no area.
double convexIou(const Polygon& a, const Polygon& b);

}  // namespace omnifleet::outline
