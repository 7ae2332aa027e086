#pragma once

#include <cmath>
#include <cstdint>

namespace omnifleet::raycast {

inline std::uint32_t mixed(std::uint32_t bits) {
  bits = (bits ^ (bits >> 16U)) * 0x7feb352dU;
  bits = (bits ^ (bits >> 15U)) * 0x846ca68bU;
  return bits ^ (bits >> 16U);
}

/// Hash of cell and seed in [0, 1].
inline double randomAt(int x, int y, unsigned seed) {
  const auto at = mixed(static_cast<std::uint32_t>(x) * 73856093U) ^
                  mixed(static_cast<std::uint32_t>(y) * 19349663U + 0x9e3779b9U);
  return mixed(at + seed * 83492791U) / 4294967295.0;
}

/// Value noise in [0, 1]: smooth interpolation between cells of size 1.
inline double smoothAt(double x, double y, unsigned seed) {
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const auto eased = [](double t) { return t * t * (3.0 - 2.0 * t); };
  const double u = eased(x - i), v = eased(y - j);
  return (randomAt(i, j, seed) * (1 - u) + randomAt(i + 1, j, seed) * u) * (1 - v) +
         (randomAt(i, j + 1, seed) * (1 - u) + randomAt(i + 1, j + 1, seed) * u) * v;
}

}  // namespace omnifleet::raycast
