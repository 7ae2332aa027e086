#pragma once

#include <cmath>
#include <cstdint>
#include <string>

namespace omnifleet::occupancy {

/// ln(p / (1 − p)) as a multiple of 2⁻¹⁶.
inline std::int32_t logOdds(double probability) {
  return static_cast<std::int32_t>(std::lround(std::log(probability / (1.0 - probability)) * 65536.0));
}

/// Appends an integer, little endian.
template <typename Integer>
void putBytes(std::string& bytes, Integer value) {
  auto rest = static_cast<std::uint64_t>(value);
  for (std::size_t i = 0; i < sizeof(Integer); ++i, rest >>= 8U)
    bytes.push_back(static_cast<char>(rest & 0xFFU));
}

}  // namespace omnifleet::occupancy
