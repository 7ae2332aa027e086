#include "outline/half_planes.h"

#include <cstddef>

namespace omnifleet::outline {
namespace {

void clipInto(const Polygon& polygon, const HalfPlane& plane, Polygon& out) {
  out.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double over_a = plane.normal.dot(a) - plane.offset_m, over_b = plane.normal.dot(b) - plane.offset_m;
    if (over_a <= 0) out.push_back(a);
    if ((over_a < 0 && over_b > 0) || (over_a > 0 && over_b < 0)) {
      out.push_back(a + (b - a) * (over_a / (over_a - over_b)));
    }
  }
  if (out.size() < 3) out.clear();
}

}  // namespace

Polygon clip(const Polygon& polygon, const HalfPlane& plane) {
  Polygon out;
  clipInto(polygon, plane, out);
  return out;
}

Polygon intersectHalfPlanes(const std::vector<HalfPlane>& planes, double bound_m) {
  Polygon current{{-bound_m, -bound_m}, {bound_m, -bound_m}, {bound_m, bound_m}, {-bound_m, bound_m}}, next;
  for (const auto& plane : planes) {
    clipInto(current, plane, next);
    current.swap(next);
    if (current.empty()) break;
  }
  return current;
}

double convexIntersectionArea(const Polygon& a, const Polygon& b) {
  if (a.size() < 3 || b.size() < 3) return 0.0;
  Polygon current = a, next;
  for (std::size_t i = 0; i < b.size() && !current.empty(); ++i) {
    const Eigen::Vector2d edge = b[(i + 1) % b.size()] - b[i];
    const Eigen::Vector2d outward(edge.y(), -edge.x());
    clipInto(current, {outward, outward.dot(b[i])}, next);
    current.swap(next);
  }
  return signedArea(current);
}

double convexIou(const Polygon& a, const Polygon& b) {
  const double shared = convexIntersectionArea(a, b);
  const double all = signedArea(a) + signedArea(b) - shared;
  return all > 0.0 ? shared / all : 0.0;
}

}  // namespace omnifleet::outline
