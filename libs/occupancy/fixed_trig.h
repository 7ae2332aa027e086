#pragma once

#include <cstdint>

#include "occupancy/contribution.h"

namespace omnifleet::occupancy {

/// Plane geometry in integers: the same result on every machine. Lengths in 0.1 mm, angles as fractions of a
/// turn in 32 bits (overflow wraps them), sine and cosine as multiples of 2⁻³⁰.
using Turn = std::uint32_t;

/// 0.1 mrad → turn; error below 1e-9 turns within ten turns.
Turn turnFromDmrad(std::int32_t angle_dmrad);
/// Bearing i of n: i/n of a turn.
inline Turn turnOfBearing(std::uint32_t i, std::uint32_t n) {
  return static_cast<Turn>((static_cast<std::uint64_t>(i) << 32U) / n);
}

struct Direction {
  std::int64_t cos_q30, sin_q30;
};
/// Taylor to the 11th power within a quarter turn: error below 1e-7.
Direction directionOf(Turn turn);

/// value / 2³⁰ to the nearest, halves away from zero.
std::int64_t roundQ30(std::int64_t value);

/// The point, rotated by the direction.
PointDmm rotate(const Direction& direction, const PointDmm& point);
/// The point, rotated back.
PointDmm unrotate(const Direction& direction, const PointDmm& point);

/// Quotient rounded down, for positive divisors.
std::int64_t floorDivide(std::int64_t value, std::int64_t divisor);
/// Largest integer whose square is not above `value` ≥ 0.
std::int64_t integerSqrt(std::int64_t value);

}  // namespace omnifleet::occupancy
