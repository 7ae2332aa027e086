// The only translation unit that includes CGAL: its exact kernels take 30 s and 1.2 GB to compile.
#include <CGAL/Boolean_set_operations_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_set_2.h>
#include <CGAL/convex_hull_2.h>

#include <algorithm>

#include "outline/convex_hull.h"
#include "outline/polygon_set.h"

namespace omnifleet::outline {
namespace {

using Inexact = CGAL::Exact_predicates_inexact_constructions_kernel;
using Exact = CGAL::Exact_predicates_exact_constructions_kernel;
using ExactPolygon = CGAL::Polygon_2<Exact>;
using ExactRegion = CGAL::Polygon_with_holes_2<Exact>;
using PolygonSet = CGAL::Polygon_set_2<Exact>;

bool isFinite(const Eigen::Vector2d& p) {
  return p.allFinite();
}

bool before(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
}

ExactPolygon exactFrom(const Polygon& polygon) {
  ExactPolygon exact;
  for (const auto& p : polygon) {
    const Exact::Point_2 point(p.x(), p.y());
    if (exact.is_empty() || *(exact.vertices_end() - 1) != point) exact.push_back(point);
  }
  return exact;
}

/// Keeps valid operands only: simple, counter-clockwise, with an area.
std::vector<ExactPolygon> operands(const std::vector<Polygon>& polygons) {
  std::vector<ExactPolygon> valid;
  for (const auto& polygon : polygons) {
    if (polygon.size() < 3 || !std::all_of(polygon.begin(), polygon.end(), isFinite)) continue;
    ExactPolygon exact = exactFrom(polygon);
    while (exact.size() > 1 && *exact.vertices_begin() == *(exact.vertices_end() - 1)) {
      exact.erase(exact.vertices_end() - 1);
    }
    if (exact.size() < 3 || !exact.is_simple()) exact = exactFrom(convexHull(polygon));
    if (exact.size() < 3 || exact.area() == 0) continue;
    if (exact.is_clockwise_oriented()) exact.reverse_orientation();
    valid.push_back(std::move(exact));
  }
  return valid;
}

PolygonSet united(const std::vector<Polygon>& polygons) {
  const auto valid = operands(polygons);
  PolygonSet set;
  set.join(valid.begin(), valid.end());
  return set;
}

Polygon polygonFrom(const ExactPolygon& exact) {
  Polygon polygon;
  for (auto v = exact.vertices_begin(); v != exact.vertices_end(); ++v) {
    polygon.emplace_back(CGAL::to_double(v->x()), CGAL::to_double(v->y()));
  }
  std::rotate(polygon.begin(), std::min_element(polygon.begin(), polygon.end(), before), polygon.end());
  return polygon;
}

std::vector<Region> regionsFrom(const PolygonSet& set) {
  std::vector<ExactRegion> pieces;
  set.polygons_with_holes(std::back_inserter(pieces));
  std::vector<Region> regions;
  for (const auto& piece : pieces) {
    Region region;
    region.outer = polygonFrom(piece.outer_boundary());
    for (auto hole = piece.holes_begin(); hole != piece.holes_end(); ++hole) {
      region.holes.push_back(polygonFrom(*hole));
    }
    std::sort(region.holes.begin(), region.holes.end(),
              [](const Polygon& a, const Polygon& b) { return before(a.front(), b.front()); });
    regions.push_back(std::move(region));
  }
  std::sort(regions.begin(), regions.end(),
            [](const Region& a, const Region& b) { return before(a.outer.front(), b.outer.front()); });
  return regions;
}

}  // namespace

Polygon convexHull(const Polygon& points) {
  std::vector<Inexact::Point_2> input, hull;
  input.reserve(points.size());
  for (const auto& p : points) {
    if (isFinite(p)) input.emplace_back(p.x(), p.y());
  }
  CGAL::convex_hull_2(input.begin(), input.end(), std::back_inserter(hull));
  Polygon polygon;
  polygon.reserve(hull.size());
  for (const auto& p : hull) polygon.emplace_back(p.x(), p.y());
  if (!polygon.empty()) {
    std::rotate(polygon.begin(), std::min_element(polygon.begin(), polygon.end(), before), polygon.end());
  }
  return polygon;
}

std::vector<Region> unite(const std::vector<Polygon>& polygons) {
  return regionsFrom(united(polygons));
}

std::vector<Region> intersect(const std::vector<Polygon>& a, const std::vector<Polygon>& b) {
  PolygonSet set = united(a);
  set.intersection(united(b));
  return regionsFrom(set);
}

std::vector<Region> subtract(const std::vector<Polygon>& from, const std::vector<Polygon>& what) {
  PolygonSet set = united(from);
  set.difference(united(what));
  return regionsFrom(set);
}

std::vector<Region> overlay(const std::vector<std::vector<Polygon>>& maps, int votes) {
  // covered[v] holds the area covered by at least v + 1 of the maps so far.
  std::vector<PolygonSet> covered(static_cast<std::size_t>(std::max(votes, 1)));
  for (const auto& map : maps) {
    const PolygonSet next = united(map);
    for (std::size_t v = covered.size() - 1; v > 0; --v) {
      PolygonSet both = covered[v - 1];
      both.intersection(next);
      covered[v].join(both);
    }
    covered[0].join(next);
  }
  return regionsFrom(covered.back());
}

}  // namespace omnifleet::outline
