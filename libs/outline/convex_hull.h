#pragma once

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// Convex hull of a point set (Choi §III.5: the outline of an object is the hull of its corrected points),
/// CGAL's exact-predicates kernel, so no rounding decides a turn. Vertices are input points,
/// counter-clockwise, collinear ones dropped, starting at the lexicographically smallest. Fewer than 3
/// distinct points come back as they are (sorted); non-finite points are left out. Any unit.
Polygon convexHull(const Polygon& points);

}  // namespace omnifleet::outline
