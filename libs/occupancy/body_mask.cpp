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
    edges_.push_back({normal_x, normal_y, normal_x * a.x_dmm + normal_y * a.y_dmm + margin * length, length});
    const std::int64_t square = std::int64_t{a.x_dmm} * a.x_dmm + std::int64_t{a.y_dmm} * a.y_dmm;
    reach_dmm_ = std::max(reach_dmm_, integerSqrt(square) + 1 + margin);
  }
}

bool BodyMask::covers(const PointDmm& p, std::int64_t more_dmm) const {
  const std::int64_t x = p.x_dmm, y = p.y_dmm, reach = std::max<std::int64_t>(reach_dmm_ + more_dmm, 0);
  if (x * x + y * y > reach * reach) return false;
  return std::all_of(edges_.begin(), edges_.end(), [&](const Edge& e) {
    return e.normal_x * x + e.normal_y * y <= e.offset + more_dmm * e.length;
  });
}

std::optional<std::int64_t> BodyMask::entry(const PointDmm& origin, const Direction& along,
                                            std::int64_t more_dmm) const {
  constexpr int kShift = 14;  // directions in 2⁻¹⁶: products of 25 bits (1.5 km) and 16 bits fit
  const std::int64_t x = origin.x_dmm, y = origin.y_dmm;
  const std::int64_t dx = along.cos_q30 >> kShift, dy = along.sin_q30 >> kShift;
  const std::int64_t across = roundQ30(x * along.sin_q30 - y * along.cos_q30);
  const std::int64_t reach = reach_dmm_ + more_dmm;
  if (across * across > reach * reach) return std::nullopt;
  const std::int64_t nearest = -roundQ30(x * along.cos_q30 + y * along.sin_q30);
  const std::int64_t half = integerSqrt(reach * reach - across * across);
  std::int64_t enters = std::max<std::int64_t>(nearest - half, 0), leaves = nearest + half;
  for (const Edge& edge : edges_) {
    const std::int64_t slack = edge.offset + more_dmm * edge.length - edge.normal_x * x - edge.normal_y * y;
    const std::int64_t rate = edge.normal_x * dx + edge.normal_y * dy;
    if (rate == 0) {
      if (slack < 0) return std::nullopt;
      continue;
    }
    const std::int64_t scaled = slack * (std::int64_t{1} << (30 - kShift));
    if (rate > 0)
      leaves = std::min(leaves, floorDivide(scaled, rate));
    else
      enters = std::max(enters, floorDivide(-scaled, -rate));
  }
  if (leaves < enters) return std::nullopt;
  return enters;
}

}  // namespace omnifleet::occupancy
