#pragma once

// Eight numbers per operation, in the vector types of the compiler. In OMNIFLEET_WIDE functions a vector is
// one register where the processor has AVX2, otherwise two; the results are equal bit by bit. Arithmetic and
// comparisons work per element. A comparison sets all bits of an element, or none.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "geometry/wide.h"

namespace omnifleet::lanes {

inline constexpr int kLanes = 8;
using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
/// Twice as many elements.
using SixteenShorts = std::int16_t __attribute__((vector_size(32)));

/// Half as many elements.
using FourFloats = float __attribute__((vector_size(16)));
using FourShorts = std::uint16_t __attribute__((vector_size(8)));

template <typename Vector>
OMNIFLEET_INLINE Vector load(const void* from) {
  Vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <typename Vector>
OMNIFLEET_INLINE void store(const Vector& v, void* to) {
  std::memcpy(to, &v, sizeof v);
}
OMNIFLEET_INLINE Floats all(float v) {
  return Floats{} + v;
}
OMNIFLEET_INLINE Floats floats(const Ints& v) {
  return __builtin_convertvector(v, Floats);
}
/// Eight bytes as floats.
OMNIFLEET_INLINE Floats floatsFromBytes(const std::uint8_t* from) {
  // By unpacking, because compilers split a conversion of bytes to floats into single elements.
  using Bytes = std::uint8_t __attribute__((vector_size(16)));
  using Shorts = std::uint16_t __attribute__((vector_size(16)));
  using Four = std::int32_t __attribute__((vector_size(16)));
  using Long = std::uint64_t __attribute__((vector_size(16)));
  const Long half = {load<std::uint64_t>(from), 0};
  const auto bytes = load<Bytes>(&half);
  const Bytes wide =
      __builtin_shufflevector(bytes, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const auto shorts = load<Shorts>(&wide);
  const Shorts low = __builtin_shufflevector(shorts, Shorts{}, 0, 8, 1, 9, 2, 10, 3, 11),
               high = __builtin_shufflevector(shorts, Shorts{}, 4, 12, 5, 13, 6, 14, 7, 15);
  return floats(__builtin_shufflevector(load<Four>(&low), load<Four>(&high), 0, 1, 2, 3, 4, 5, 6, 7));
}
OMNIFLEET_INLINE FourFloats floats(const FourShorts& v) {
  using Shorts = std::uint16_t __attribute__((vector_size(16)));
  using Four = std::int32_t __attribute__((vector_size(16)));
  using Long = std::uint64_t __attribute__((vector_size(16)));
  const Long half = {load<std::uint64_t>(&v), 0};
  const Shorts wide = __builtin_shufflevector(load<Shorts>(&half), Shorts{}, 0, 8, 1, 9, 2, 10, 3, 11);
  return __builtin_convertvector(load<Four>(&wide), FourFloats);
}
/// Rounds towards zero.
OMNIFLEET_INLINE Ints truncated(const Floats& v) {
  return __builtin_convertvector(v, Ints);
}
OMNIFLEET_INLINE Floats larger(const Floats& a, const Floats& b) {
  return a > b ? a : b;
}
OMNIFLEET_INLINE Floats smaller(const Floats& a, const Floats& b) {
  return a < b ? a : b;
}
OMNIFLEET_INLINE Floats magnitude(const Floats& v) {
  return v < 0.0f ? -v : v;
}
OMNIFLEET_INLINE Floats squareRoot(const Floats& v) {
  Floats root;
  for (int k = 0; k < kLanes; ++k) root[k] = std::sqrt(v[k]);
  return root;
}
/// True if the comparison result `v` is true in any lane.
OMNIFLEET_INLINE bool any(const Ints& v) {
  using Longs = std::int64_t __attribute__((vector_size(32)));
  const auto longs = load<Longs>(&v);
  return ((longs[0] | longs[1]) | (longs[2] | longs[3])) != 0;
}
/// Sum in a fixed order, so that it is equal on every processor.
OMNIFLEET_INLINE float sum(const Floats& v) {
  return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]));
}

}  // namespace omnifleet::lanes
