#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>

#include "geometry/wide.h"
#include "ground/strip.h"

namespace omnifleet::ground {

/// Memory layout that masks of one size share.
struct MaskLayout {
  cv::Size size;
  std::ptrdiff_t step;  ///< bytes between rows
  explicit MaskLayout(const cv::Mat1b& mask)
      : size(mask.size()), step(static_cast<std::ptrdiff_t>(mask.step1())) {}
};

/// Calls kernel.run<rows, columns>(offset) for blocks that together cover the strips, except for pixels
/// within `margin` of the image border. The offset is that of the block's first pixel in a mask. Blocks may
/// overlap, so a kernel must not write what it reads nearby. For OMNIFLEET_WIDE functions.
template <typename Kernel>
OMNIFLEET_INLINE void overStrips(const Strip* strips, std::size_t count, const MaskLayout& layout, int margin,
                                 const Kernel& kernel) {
  constexpr int kRows = FloorView::kCell, kWide = 32, kNarrow = 16;
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = std::max(strip->begin_px, margin),
              end = std::min(strip->end_px, layout.size.width - margin);
    const int top = std::max(strip->cell_row * kRows, margin),
              bottom = std::min((strip->cell_row + 1) * kRows, layout.size.height - margin);
    const auto at = [&](int x, int y) { return y * layout.step + x; };
    if (bottom - top == kRows && end - begin >= kWide) {
      for (int x = begin; x < end; x += kWide)
        kernel.template run<kRows, kWide>(at(std::min(x, end - kWide), top));
    } else if (bottom - top == kRows && end - begin >= kNarrow) {
      for (int x = begin; x < end; x += kNarrow)
        kernel.template run<kRows, kNarrow>(at(std::min(x, end - kNarrow), top));
    } else {
      for (int y = top; y < bottom; ++y)
        for (int x = begin; x < end; ++x) kernel.template run<1, 1>(at(x, y));
    }
  }
}

struct Largest {
  static OMNIFLEET_INLINE std::uint8_t of(std::uint8_t a, std::uint8_t b) { return a > b ? a : b; }
};
struct Smallest {
  static OMNIFLEET_INLINE std::uint8_t of(std::uint8_t a, std::uint8_t b) { return a < b ? a : b; }
};
/// out[y][x] = Join over the square of side 2·kRadius + 1 around from[y · step + x].
template <typename Join, int kRadius, int kRows, int kColumns>
OMNIFLEET_INLINE void joinSquares(const std::uint8_t* from, std::ptrdiff_t step,
                                  std::uint8_t (&out)[kRows][kColumns]) {
  std::uint8_t along[kRows + 2 * kRadius][kColumns];  // Join along each row
  for (int y = 0; y < kRows + 2 * kRadius; ++y) {
    const std::uint8_t* row = from + (y - kRadius) * step - kRadius;
    for (int x = 0; x < kColumns; ++x) {
      std::uint8_t value = row[x];
      for (int k = 1; k <= 2 * kRadius; ++k) value = Join::of(value, row[x + k]);
      along[y][x] = value;
    }
  }
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      std::uint8_t value = along[y][x];
      for (int k = 1; k <= 2 * kRadius; ++k) value = Join::of(value, along[y + k][x]);
      out[y][x] = value;
    }
  }
}

}  // namespace omnifleet::ground
