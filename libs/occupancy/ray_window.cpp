#include "occupancy/ray_window.h"

#include <algorithm>

namespace omnifleet::occupancy {

PointDmm scanOrigin(const Contribution& contribution, const IntegerPose& at) {
  const PointDmm offset = rotate(directionOf(turnFromDmrad(at.theta_dmrad)), contribution.scan_origin);
  return {at.position.x_dmm + offset.x_dmm, at.position.y_dmm + offset.y_dmm};
}

RayExtent extentOf(const Contribution& contribution, std::size_t i, RayRole role, const RayLimits& limits,
                   const RayCuts& cuts) {
  const std::int64_t range = contribution.range_dmm[i], max_range = limits.max_range;
  const bool only_end = role == RayRole::kHitOnly || role == RayRole::kHitBeyond;
  if (const std::int64_t cut = rangeOf(contribution, i, cuts); cut < range) {
    const std::int64_t end = std::min(cut, max_range);
    return {end, only_end ? end : 0, RayRole::kOpen};
  }
  if (range > max_range && only_end) return {max_range, max_range, RayRole::kOpen};
  if (role == RayRole::kFree) return {std::min(range, max_range), 0, role};
  const std::int64_t sigma = i < contribution.sigma_dmm.size() ? contribution.sigma_dmm[i] : 0;
  if (range > max_range) {
    const std::int64_t floor_end = range - sigma * limits.free_permille / 1000;
    if (floor_end >= max_range) return {max_range, 0, RayRole::kFree};
    return {max_range, std::min(max_range - floor_end, max_range), RayRole::kOpen};
  }
  const bool is_vague = role != RayRole::kOpen && 1000 * sigma > limits.hit_permille * limits.resolution;
  if (only_end)
    return {range, range, is_vague ? RayRole::kOpen : RayRole::kHit,
            !is_vague && role == RayRole::kHitBeyond};
  return {range, std::min(sigma * limits.free_permille / 1000, range), is_vague ? RayRole::kOpen : role};
}

RayWindow::RayWindow(const RayLimits& limits) : limits_(limits) {
  const int radius = static_cast<int>(limits.max_range / limits.resolution) + 2;
  chunks_ = (2 * radius + kChunk - 1) / kChunk + 1;
  width_ = chunks_ * kChunk;
  marks_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(width_));
}

void RayWindow::draw(const Contribution& contribution, const IntegerPose& at,
                     const std::vector<RayRole>& roles, const RayCuts& cuts) {
  std::fill(marks_.begin(), marks_.end(), std::uint8_t{0});
  const PointDmm origin = scanOrigin(contribution, at);
  const std::int64_t radius = limits_.max_range / limits_.resolution + 2;
  first_x_ = floorDivide(floorDivide(origin.x_dmm, limits_.resolution) - radius, kChunk) * kChunk;
  first_y_ = floorDivide(floorDivide(origin.y_dmm, limits_.resolution) - radius, kChunk) * kChunk;
  const Turn heading = turnFromDmrad(at.theta_dmrad);
  const auto count = static_cast<std::uint32_t>(roles.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    if (roles[i] == RayRole::kNone) continue;
    const RayExtent ray = extentOf(contribution, i, roles[i], limits_, cuts);
    const Direction d = directionOf(heading + turnOfBearing(i, count));
    const auto pointAt = [&](std::int64_t length) {
      return PointDmm{static_cast<std::int32_t>(origin.x_dmm + roundQ30(length * d.cos_q30)),
                      static_cast<std::int32_t>(origin.y_dmm + roundQ30(length * d.sin_q30))};
    };
    drawRay(origin, pointAt(ray.range - ray.free), ray.role == RayRole::kFree ? kMiss : 0);
    if (ray.role == RayRole::kHit) mark(pointAt(ray.range), kHit);
  }
}

void RayWindow::mark(const PointDmm& at, std::uint8_t bit) {
  const std::int64_t x = floorDivide(at.x_dmm, limits_.resolution) - first_x_,
                     y = floorDivide(at.y_dmm, limits_.resolution) - first_y_;
  marks_[static_cast<std::size_t>(y * width_ + x)] |= bit;
}

void RayWindow::drawRay(const PointDmm& from, const PointDmm& to, std::uint8_t at_end) {
  // From here on lengths are relative to the window, so never negative.
  const std::int64_t left = first_x_ * limits_.resolution, low = first_y_ * limits_.resolution;
  const std::int64_t x0 = from.x_dmm - left, y0 = from.y_dmm - low, x1 = to.x_dmm - left, y1 = to.y_dmm - low;
  const std::int64_t cell_x = x0 / limits_.resolution, cell_y = y0 / limits_.resolution;
  const std::int64_t dx = std::abs(x1 - x0), dy = std::abs(y1 - y0);
  const std::int64_t steps =
      std::abs(x1 / limits_.resolution - cell_x) + std::abs(y1 / limits_.resolution - cell_y);
  // Time to the next border, times dx·dy: crossing x costs (distance to it)·dy, crossing y costs (distance to
  // it)·dx.
  const std::int64_t in_x = x0 - cell_x * limits_.resolution, in_y = y0 - cell_y * limits_.resolution;
  std::int64_t next_x = (x1 >= x0 ? limits_.resolution - in_x : in_x + 1) * dy;
  std::int64_t next_y = (y1 >= y0 ? limits_.resolution - in_y : in_y + 1) * dx;
  const std::int64_t add_x = limits_.resolution * dy, add_y = limits_.resolution * dx;
  const std::int64_t step_x = x1 >= x0 ? 1 : -1,
                     step_y = (y1 >= y0 ? 1 : -1) * static_cast<std::int64_t>(width_);
  std::uint8_t* cell = &marks_[static_cast<std::size_t>(cell_y * width_ + cell_x)];
  for (std::int64_t i = 0; i < steps; ++i) {
    *cell |= kMiss;
    const bool across_x = next_x < next_y;
    cell += across_x ? step_x : step_y;
    next_x += across_x ? add_x : 0;
    next_y += across_x ? 0 : add_y;
  }
  *cell |= at_end;
}

void RayWindow::cover(const BodyMask& body, const IntegerPose& at, std::int64_t more_dmm, std::uint8_t bit) {
  forEachCovered(body, at, more_dmm, limits_.resolution, [&](std::int64_t x, std::int64_t y) {
    const std::int64_t column = x - first_x_, row = y - first_y_;
    if (column < 0 || row < 0 || column >= width_ || row >= width_) return;
    marks_[static_cast<std::size_t>(row * width_ + column)] |= bit;
  });
}

bool RayWindow::isNear(const BodyMask& body, const IntegerPose& at, std::int64_t more_dmm,
                       const Contribution& contribution, const IntegerPose& of) const {
  const PointDmm origin = scanOrigin(contribution, of);
  const std::int64_t reach = limits_.max_range + 2 * limits_.resolution + body.reachDmm() + more_dmm;
  const std::int64_t dx = std::int64_t{at.position.x_dmm} - origin.x_dmm,
                     dy = std::int64_t{at.position.y_dmm} - origin.y_dmm;
  return std::abs(dx) <= reach && std::abs(dy) <= reach;
}

}  // namespace omnifleet::occupancy
