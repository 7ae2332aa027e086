#pragma once

#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// A connected piece of the plane: outer border counter-clockwise, holes clockwise.
struct Region {
  Polygon outer;
  std::vector<Polygon> holes;

  double area() const;
};
double area(const std::vector<Region>& regions);

/// Set operations with CGAL's exact-constructions kernel; simple polygons of either orientation, overlaps
/// welcome. Polygons of fewer than 3 vertices, of no area or with non-finite vertices are left out; one that
/// crosses itself stands for its convex hull. The union is made in one batch (25 times faster than one by
/// one). Regions come in the order of their lexicographically smallest vertex, which is also where each
/// border starts.
std::vector<Region> unite(const std::vector<Polygon>& polygons);
std::vector<Region> intersect(const std::vector<Polygon>& a, const std::vector<Polygon>& b);
std::vector<Region> subtract(const std::vector<Polygon>& from, const std::vector<Polygon>& what);

/// Overlay of maps (Choi §IV.4, "overlaying the local maps"): each map is a set of polygons in one frame. The
/// pieces are those covered by at least `votes` of the maps.
std::vector<Region> overlay(const std::vector<std::vector<Polygon>>& maps, int votes = 1);

/// Area of the intersection ÷ area of the union; 0 where either has no area.
double iou(const Polygon& a, const Polygon& b);

}  // namespace omnifleet::outline
