#pragma once

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// Convex hull of a point set (Choi §III.5: the outline of an object is the hull of its corrected points).
/// CGAL's exact-predicates kernel: rounding never decides a turn. The vertices are input points,
/// counter-clockwise, without collinear ones, starting at the lexicographically smallest. Fewer than 3
/// distinct points are returned as they are (sorted). Non-finite points are omitted. Any unit.
Polygon convexHull(const Polygon& points);

}  // namespace omnifleet::outline
