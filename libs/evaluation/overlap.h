#pragma once

#include "geometry/polygon.h"

namespace omnifleet::evaluation {

/// Area of the intersection of two simple polygons, m². Convex or not, either orientation; exact except for
/// rounding (overlay of Boost.Geometry). A self-intersecting polygon is replaced by its convex hull.
double intersectionArea(const Polygon& a, const Polygon& b);

/// Intersection over union in [0, 1]. 0 if either polygon has no area.
double intersectionOverUnion(const Polygon& a, const Polygon& b);

}  // namespace omnifleet::evaluation
