#pragma once

// Deterministic hashes and value noise, equal on every machine. Private to this library.

#include <cmath>
#include <cstdint>

namespace omnifleet::synthetic {

/// Mixes the bits of a number (Wellons' lowbias32).
inline std::uint32_t hash32(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352dU;
  x ^= x >> 15;
  x *= 0x846ca68bU;
  x ^= x >> 16;
  return x;
}
inline std::uint32_t hash32(std::uint32_t a, std::uint32_t b) {
  return hash32(a ^ (hash32(b) + 0x9e3779b9U));
}

/// Uniform in [−1, 1] at a lattice point.
inline float latticeValue(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
  const std::uint32_t mixed = static_cast<std::uint32_t>(x) * 0x8da6b343U +
                              static_cast<std::uint32_t>(y) * 0xd8163841U +
                              static_cast<std::uint32_t>(z) * 0xcb1ab31fU + seed;
  return static_cast<float>(hash32(mixed) >> 8) * (2.0f / 16777215.0f) - 1.0f;
}

inline float smoothStep(float t) {
  return t * t * (3.0f - 2.0f * t);
}
inline float mix(float a, float b, float t) {
  return a + (b - a) * t;
}

/// Smooth noise in [−1, 1] with one lattice cell per unit.
inline float valueNoise(float x, float y, float z, std::uint32_t seed) {
  const float fx = std::floor(x), fy = std::floor(y), fz = std::floor(z);
  const auto ix = static_cast<std::int32_t>(fx), iy = static_cast<std::int32_t>(fy),
             iz = static_cast<std::int32_t>(fz);
  const float tx = smoothStep(x - fx), ty = smoothStep(y - fy), tz = smoothStep(z - fz);
  float plane[2];
  for (int k = 0; k < 2; ++k) {
    const float low = mix(latticeValue(ix, iy, iz + k, seed), latticeValue(ix + 1, iy, iz + k, seed), tx);
    const float high =
        mix(latticeValue(ix, iy + 1, iz + k, seed), latticeValue(ix + 1, iy + 1, iz + k, seed), tx);
    plane[k] = mix(low, high, ty);
  }
  return mix(plane[0], plane[1], tz);
}

/// Smooth noise in the plane.
inline float valueNoise(float x, float y, std::uint32_t seed) {
  const float fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<std::int32_t>(fx), iy = static_cast<std::int32_t>(fy);
  const float tx = smoothStep(x - fx), ty = smoothStep(y - fy);
  const float low = mix(latticeValue(ix, iy, 0, seed), latticeValue(ix + 1, iy, 0, seed), tx);
  const float high = mix(latticeValue(ix, iy + 1, 0, seed), latticeValue(ix + 1, iy + 1, 0, seed), tx);
  return mix(low, high, ty);
}

}  // namespace omnifleet::synthetic
