#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "occupancy/contribution.h"
#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {

/// The bearings 2πi/n of a scan. Finds the rays on both sides of a direction, exactly, in integers.
class Bearings {
 public:
  Bearings() = default;
  explicit Bearings(std::size_t rays);

  std::size_t size() const { return directions_.size(); }
  /// The last bearing that does not exceed the direction of a non-zero vector.
  std::size_t before(const PointDmm& to) const;

 private:
  static constexpr std::size_t kSectors = 512;  ///< per turn; enough that each contains few rays
  static std::size_t sectorOf(const PointDmm& to);
  bool isBeyond(std::size_t ray, const PointDmm& to) const;

  std::vector<Direction> directions_;
  std::array<std::uint32_t, kSectors> first_{};  ///< per sector, a bearing before its start
};

}  // namespace omnifleet::occupancy
