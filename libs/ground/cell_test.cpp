#include "ground/cell_test.h"

#include <cmath>

#include "geometry/lanes.h"
#include "ground/appearance_class.h"

namespace omnifleet::ground {

namespace {

using lanes::Floats;
using lanes::Ints;
using Sixteen = std::uint8_t __attribute__((vector_size(16)));
using ThirtyTwo = std::uint8_t __attribute__((vector_size(32)));

/// Two rows of four pixels.
struct EightPixels {
  Floats blue, green, red;
};

OMNIFLEET_INLINE EightPixels loadColours(const std::uint8_t* upper, const std::uint8_t* lower) {
  const auto a = lanes::load<Sixteen>(upper), b = lanes::load<Sixteen>(lower);
  const ThirtyTwo both =
      __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20,
                              21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31);
  // Spreads each pixel plus one further byte to a 32-bit number.
  const ThirtyTwo spread =
      __builtin_shufflevector(both, both, 0, 1, 2, 3, 3, 4, 5, 6, 6, 7, 8, 9, 9, 10, 11, 12, 16, 17, 18, 19,
                              19, 20, 21, 22, 22, 23, 24, 25, 25, 26, 27, 28);
  const Ints pixel = lanes::load<Ints>(&spread);
  return {lanes::floats(pixel & 255), lanes::floats((pixel >> 8) & 255), lanes::floats((pixel >> 16) & 255)};
}

OMNIFLEET_INLINE EightPixels loadGreys(const std::uint8_t* upper, const std::uint8_t* lower) {
  std::uint8_t eight[8];
  std::memcpy(eight, upper, 4);
  std::memcpy(eight + 4, lower, 4);
  const Floats grey = lanes::floatsFromBytes(eight);
  return {grey, grey, grey};
}

/// Stores the low bytes of four numbers per row, masked by `valid`.
OMNIFLEET_INLINE void storeFours(const Ints& values, const std::uint8_t* const (&valid)[2],
                                 std::uint8_t* const (&rows)[2]) {
  const auto bytes = lanes::load<ThirtyTwo>(&values);
  const ThirtyTwo low =
      __builtin_shufflevector(bytes, bytes, 0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12, 16, 20, 24,
                              28, 16, 20, 24, 28, 16, 20, 24, 28, 16, 20, 24, 28);
  const auto fours = lanes::load<Ints>(&low);
  for (int k = 0; k < 2; ++k) {
    std::int32_t mask = 0;
    std::memcpy(&mask, valid[k], 4);
    const std::int32_t four = fours[4 * k] & mask;
    std::memcpy(rows[k], &four, 4);
  }
}

struct Limits {
  const float *blue, *green, *red;
  float *squared, *length, *along2, *across2;
};

OMNIFLEET_WIDE void settleCells(const Limits& cells, std::size_t n, const CellTolerance& tolerance) {
  const auto [along, across, noise_sigmas, channel, hue] = tolerance;
  const auto [b, g, r, squared_of, length_of, along2_of, across2_of] = cells;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float squared = b[i] * b[i] + g[i] * g[i] + r[i] * r[i], rr = squared > 1.0f ? squared : 1.0f;
    const float length = std::sqrt(rr), per_level = noise_sigmas / length;
    const float a = along + channel * per_level, c = across + hue * per_level;
    squared_of[i] = rr;
    length_of[i] = length;
    along2_of[i] = a * a;
    across2_of[i] = c * c;
  }
}

template <bool kFaint, typename Load>
OMNIFLEET_INLINE void testCell(Load loadPixels, CellBytes<const std::uint8_t> pixels, const CellTest& t,
                               CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                               CellBytes<std::uint8_t> appearances) {
  for (int k = 0; k < 4; k += 2) {
    const auto [b, g, r] =
        loadPixels(pixels.first + k * pixels.row_step, pixels.first + (k + 1) * pixels.row_step);
    const Floats gain = (b * t.blue + g * t.green + r * t.red) / t.squared;
    const Floats across = ((b * b + g * g + r * r) / t.squared - gain * gain) * t.across;
    const Floats hue = across > t.least_hue ? across : Floats{};
    Floats off = lanes::larger((gain - 1.0f) * (gain - 1.0f) * t.along, hue);
    Ints has_hue = hue > t.other_hue;
    if constexpr (kFaint) {
      const Floats faint = 1.0f + b * t.to_blue + g * t.to_green + r * t.to_red -
                           lanes::larger(gain, lanes::all(t.least_gain));
      off = lanes::larger(off, faint);
      has_hue |= faint > 1.0f;
    }
    const Ints is_off = off > 1.0f;
    const Ints grey = lanes::truncated(2.0f + lanes::smaller(lanes::all(253.0f), 100.0f * gain));
    const Ints appearance = ((has_hue & kColourAppearance) | (~has_hue & grey)) & is_off;
    const Ints strong = lanes::truncated(lanes::smaller(off, lanes::all(255.0f))) & is_off;
    const auto rowOf = [k](const auto& cell, int row) { return cell.first + (k + row) * cell.row_step; };
    const std::uint8_t* const counts[2] = {rowOf(valid, 0), rowOf(valid, 1)};
    storeFours(strong, counts, {rowOf(strength, 0), rowOf(strength, 1)});
    storeFours(appearance, counts, {rowOf(appearances, 0), rowOf(appearances, 1)});
  }
}

}  // namespace

void CellLimits::settle(const CellTolerance& tolerance) {
  settleCells({column(kFloor), column(kFloor + 1), column(kFloor + 2), column(kSquared), column(kLength),
               column(kAlong2), column(kAcross2)},
              size(), tolerance);
}

OMNIFLEET_WIDE void testColourCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                                   CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                                   CellBytes<std::uint8_t> appearances) {
  if (test.to_blue != 0.0f || test.to_green != 0.0f || test.to_red != 0.0f)
    testCell<true>(loadColours, pixels, test, valid, strength, appearances);
  else
    testCell<false>(loadColours, pixels, test, valid, strength, appearances);
}

OMNIFLEET_WIDE void testGreyCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                                 CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                                 CellBytes<std::uint8_t> appearances) {
  testCell<false>(loadGreys, pixels, test, valid, strength, appearances);
}

}  // namespace omnifleet::ground
