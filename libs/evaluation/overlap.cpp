#include "evaluation/overlap.h"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
#include <cmath>
#include <vector>

namespace omnifleet::evaluation {
namespace {

namespace bg = boost::geometry;
using Point = bg::model::d2::point_xy<double>;
using Shape = bg::model::polygon<Point, false, true>;  // counter-clockwise, closed

Shape shape(const Polygon& polygon, const Eigen::Vector2d& origin) {
  Shape result;
  for (const Eigen::Vector2d& p : polygon) bg::append(result, Point(p.x() - origin.x(), p.y() - origin.y()));
  bg::correct(result);
  if (bg::intersects(result)) {  // self-intersection
    Shape hull;
    bg::convex_hull(result, hull);
    return hull;
  }
  return result;
}

}  // namespace

double intersectionArea(const Polygon& a, const Polygon& b) {
  if (a.size() < 3 || b.size() < 3) return 0.0;
  const Eigen::Vector2d origin = a.front();  // close to the polygons, for precision
  std::vector<Shape> common;
  bg::intersection(shape(a, origin), shape(b, origin), common);
  double area = 0.0;
  for (const Shape& part : common) area += std::abs(bg::area(part));
  return area;
}

double intersectionOverUnion(const Polygon& a, const Polygon& b) {
  if (a.size() < 3 || b.size() < 3) return 0.0;
  const double area_a = std::abs(bg::area(shape(a, a.front()))),
               area_b = std::abs(bg::area(shape(b, b.front())));
  if (!(area_a > 0.0) || !(area_b > 0.0)) return 0.0;
  const double common = intersectionArea(a, b);
  return std::clamp(common / (area_a + area_b - common), 0.0, 1.0);
}

}  // namespace omnifleet::evaluation
