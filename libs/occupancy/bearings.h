#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "occupancy/contribution.h"
#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {

/// The bearings 2πi/n of a scan, to find the rays on both sides of a direction; exact, in integers.
class Bearings {
 public:
  Bearings() = default;
  explicit Bearings(std::size_t rays);

  std::size_t size() const { return directions_.size(); }
  /// The last bearing that is not beyond the direction of a vector that is not zero.
  std::size_t before(const PointDmm& to) const;

 private:
  static constexpr std::size_t kSectors = 512;  ///< of a turn; so many that one holds few rays
  static std::size_t sectorOf(const PointDmm& to);
  bool isBeyond(std::size_t ray, const PointDmm& to) const;

  std::vector<Direction> directions_;
  std::array<std::uint32_t, kSectors> first_{};  ///< per sector, a bearing before its beginning
};

}  // namespace omnifleet::occupancy
