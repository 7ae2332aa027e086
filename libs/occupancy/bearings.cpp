#include "occupancy/bearings.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::occupancy {

Bearings::Bearings(std::size_t rays) {
  const auto n = static_cast<std::uint32_t>(rays);
  for (std::uint32_t i = 0; i < n; ++i) directions_.push_back(directionOf(turnOfBearing(i, n)));
  for (std::size_t k = 0; k < kSectors; ++k) {
    // Sectors are equal parts of the square |x| + |y| = 1.
    const double along = 4.0 * static_cast<double>(k) / kSectors;
    const double share = along - std::floor(along), quarter = std::floor(along);
    const double angle = 0.5 * M_PI * quarter + std::atan2(share, 1.0 - share);
    const double ray = std::floor(angle / (2.0 * M_PI) * static_cast<double>(rays));
    first_[k] =
        static_cast<std::uint32_t>(std::max(0.0, ray - 1.0));  // one more, so that rounding does not matter
  }
}

std::size_t Bearings::sectorOf(const PointDmm& to) {
  const double x = to.x_dmm, y = to.y_dmm, sum = std::abs(x) + std::abs(y);
  const double along = y >= 0 ? (x > 0 ? y / sum : 1.0 - x / sum) : (x < 0 ? 2.0 - y / sum : 3.0 + x / sum);
  return std::min(kSectors - 1, static_cast<std::size_t>(along * (kSectors / 4.0)));
}

bool Bearings::isBeyond(std::size_t ray, const PointDmm& to) const {
  const Direction& d = directions_[ray];
  const bool low = to.y_dmm < 0 || (to.y_dmm == 0 && to.x_dmm < 0);  // in the second half of the turn
  if ((2 * ray >= directions_.size()) != low) return !low;
  return d.cos_q30 * to.y_dmm - d.sin_q30 * to.x_dmm < 0;
}

std::size_t Bearings::before(const PointDmm& to) const {
  std::size_t ray = first_[sectorOf(to)];
  while (ray + 1 < directions_.size() && !isBeyond(ray + 1, to)) ++ray;
  return ray;
}

}  // namespace omnifleet::occupancy
