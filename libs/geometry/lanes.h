#pragma once

// Eight numbers at a time, in the language's own vectors: in OMNIFLEET_WIDE functions one register where the
// processor has AVX2, two elsewhere, with the same bits. Arithmetic and comparisons work element by element;
// a comparison gives all bits set or none.

#include <cstdint>
#include <cstring>

#include "geometry/wide.h"

namespace omnifleet::lanes {

inline constexpr int kLanes = 8;
using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
using Bytes = std::uint8_t __attribute__((vector_size(8)));

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
/// Eight bytes as numbers.
OMNIFLEET_INLINE Floats floatsFromBytes(const std::uint8_t* from) {
  return __builtin_convertvector(load<Bytes>(from), Floats);
}
/// Towards zero.
OMNIFLEET_INLINE Ints truncated(const Floats& v) {
  return __builtin_convertvector(v, Ints);
}
OMNIFLEET_INLINE Floats larger(const Floats& a, const Floats& b) {
  return a > b ? a : b;
}
OMNIFLEET_INLINE Floats smaller(const Floats& a, const Floats& b) {
  return a < b ? a : b;
}
/// In a fixed order, the same everywhere.
OMNIFLEET_INLINE float sum(const Floats& v) {
  return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]));
}

}  // namespace omnifleet::lanes
