#include "outline/polygon_set.h"

#include <cmath>

namespace omnifleet::outline {

double Region::area() const {
  double sum = std::abs(signedArea(outer));
  for (const auto& hole : holes) sum -= std::abs(signedArea(hole));
  return sum;
}

double area(const std::vector<Region>& regions) {
  double sum = 0.0;
  for (const auto& region : regions) sum += region.area();
  return sum;
}

double iou(const Polygon& a, const Polygon& b) {
  const double area_a = std::abs(signedArea(a)), area_b = std::abs(signedArea(b));
  if (area_a <= 0.0 || area_b <= 0.0) return 0.0;
  const double shared = area(intersect({a}, {b}));
  return shared / (area_a + area_b - shared);
}

}  // namespace omnifleet::outline
