#pragma once

#include "geometry/polygon.h"

namespace omnifleet::evaluation {

/// Area of the intersection of two simple polygons, convex or not, either orientation; exact up to rounding
/// (Boost.Geometry's overlay). A self-intersecting polygon is replaced by its convex hull. m².
double intersectionArea(const Polygon& a, const Polygon& b);

/// Intersection over union in [0, 1]; 0 where either has no area.
double intersectionOverUnion(const Polygon& a, const Polygon& b);

}  // namespace omnifleet::evaluation
