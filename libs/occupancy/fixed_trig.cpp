#include "occupancy/fixed_trig.h"

#include <cmath>

namespace omnifleet::occupancy {
namespace {

constexpr std::int64_t kOne = std::int64_t{1} << 30U;

/// sin(π/2·x) for x in [0, 1], both as multiples of 2⁻³⁰. Every intermediate is positive.
std::int64_t sineOfQuarter(std::int64_t x) {
  // (π/2)ⁿ/n!, n = 1, 3, … 11.
  constexpr std::int64_t kTerms[] = {1686629713, 693598668, 85569306, 5026995, 172272, 3864};
  const std::int64_t square = (x * x) >> 30U;
  std::int64_t sum = kTerms[5];
  for (int i = 4; i >= 0; --i) sum = kTerms[i] - ((square * sum) >> 30U);
  return (x * sum) >> 30U;
}

std::int64_t sineOf(Turn turn) {
  const std::int64_t within = turn & 0x3FFFFFFFU;
  switch (turn >> 30U) {
    case 0:
      return sineOfQuarter(within);
    case 1:
      return sineOfQuarter(kOne - within);
    case 2:
      return -sineOfQuarter(within);
    default:
      return -sineOfQuarter(kOne - within);
  }
}

}  // namespace

Turn turnFromDmrad(std::int32_t angle_dmrad) {
  constexpr std::uint64_t kTurnsPerDmradQ48 = 4479813390;  // 2⁴⁸ / (20000 π)
  const auto wide = static_cast<std::uint64_t>(static_cast<std::int64_t>(angle_dmrad));
  return static_cast<Turn>((wide * kTurnsPerDmradQ48) >> 16U);  // modulo 2⁶⁴: whole turns drop out
}

Direction directionOf(Turn turn) {
  return {sineOf(turn + 0x40000000U), sineOf(turn)};
}

std::int64_t roundQ30(std::int64_t value) {
  constexpr std::int64_t kHalf = kOne / 2;
  return value >= 0 ? (value + kHalf) / kOne : -((-value + kHalf) / kOne);
}

PointDmm rotate(const Direction& d, const PointDmm& p) {
  return {static_cast<std::int32_t>(roundQ30(d.cos_q30 * p.x_dmm - d.sin_q30 * p.y_dmm)),
          static_cast<std::int32_t>(roundQ30(d.sin_q30 * p.x_dmm + d.cos_q30 * p.y_dmm))};
}

PointDmm unrotate(const Direction& d, const PointDmm& p) {
  return rotate({d.cos_q30, -d.sin_q30}, p);
}

std::int64_t floorDivide(std::int64_t value, std::int64_t divisor) {
  const std::int64_t quotient = value / divisor;
  return quotient * divisor > value ? quotient - 1 : quotient;
}

std::int64_t integerSqrt(std::int64_t value) {
  auto root = static_cast<std::int64_t>(std::sqrt(static_cast<double>(value)));
  while (root * root > value) --root;
  while ((root + 1) * (root + 1) <= value) ++root;
  return root;
}

}  // namespace omnifleet::occupancy
