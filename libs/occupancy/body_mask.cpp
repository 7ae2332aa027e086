#include "occupancy/body_mask.h"

#include <algorithm>
#include <cmath>

#include "outline/convex_hull.h"

namespace omnifleet::occupancy {

BodyMask::BodyMask(const RobotBody& body, double margin_m, double default_radius_m) {
  const auto margin = static_cast<std::int64_t>(std::llround(margin_m * 1e4));
  const Polygon hull = outline::convexHull(body.footprint_m);
  if (hull.size() < 3) {
    const double radius = body.radius_m > 0 ? body.radius_m : default_radius_m;
    reach_dmm_ = static_cast<std::int64_t>(std::llround(radius * 1e4)) + margin;
    return;
  }
  std::vector<PointDmm> corners;
  for (const auto& p : hull) {
    corners.push_back({static_cast<std::int32_t>(std::lround(p.x() * 1e4)),
                       static_cast<std::int32_t>(std::lround(p.y() * 1e4))});
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const PointDmm &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const std::int64_t normal_x = b.y_dmm - a.y_dmm, normal_y = a.x_dmm - b.x_dmm;
    const std::int64_t length = integerSqrt(normal_x * normal_x + normal_y * normal_y) + 1;
    edges_.push_back({normal_x, normal_y, normal_x * a.x_dmm + normal_y * a.y_dmm + margin * length});
    const std::int64_t square = std::int64_t{a.x_dmm} * a.x_dmm + std::int64_t{a.y_dmm} * a.y_dmm;
    reach_dmm_ = std::max(reach_dmm_, integerSqrt(square) + 1 + margin);
  }
}

bool BodyMask::covers(const PointDmm& p) const {
  const std::int64_t x = p.x_dmm, y = p.y_dmm;
  if (x * x + y * y > reach_dmm_ * reach_dmm_) return false;
  return std::all_of(edges_.begin(), edges_.end(),
                     [&](const Edge& e) { return e.normal_x * x + e.normal_y * y <= e.offset; });
}

}  // namespace omnifleet::occupancy
