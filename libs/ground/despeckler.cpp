#include "ground/despeckler.h"

#include "ground/bit_ops.h"
#include "ground/strip_kernels.h"

namespace omnifleet::ground {

namespace {

constexpr int kHalo = 8;  // squared distance from floor, √8 times weaker than the strongest neighbour
constexpr int kHaloReach = 2;

/// Writes 1 where a pixel is set and is no halo, else 0.
struct HaloKernel {
  const std::uint8_t* strength;
  std::uint8_t* raw;
  std::ptrdiff_t step;

  template <int kRows, int kColumns>
  OMNIFLEET_INLINE void run(std::ptrdiff_t at) const {
    std::uint8_t strongest[kRows][kColumns], weakest[kRows][kColumns];
    joinSquares<Largest, kHaloReach>(strength + at, step, strongest);
    joinSquares<Smallest, kHaloReach>(strength + at, step, weakest);
    for (int y = 0; y < kRows; ++y) {
      const std::uint8_t* own = strength + at + y * step;
      std::uint8_t* to = raw + at + y * step;
      for (int x = 0; x < kColumns; ++x) {
        const bool halo = (own[x] < strongest[y][x] / kHalo) & (weakest[y][x] == 0);
        to[x] = (own[x] != 0) & !halo ? 1 : 0;
      }
    }
  }
};

OMNIFLEET_WIDE void dropHalos(const Strip* strips, std::size_t count, const MaskLayout& layout,
                              const std::uint8_t* strength, std::uint8_t* raw) {
  overStrips(strips, count, layout, kHaloReach, HaloKernel{strength, raw, layout.step});
}

}  // namespace

void Despeckler::trimHalos(const std::vector<Strip>& strips, const cv::Mat1b& strength, cv::Mat1b& raw) {
  const MaskLayout layout(raw);
  for (const Strip& strip : strips) {  // pixels at the image's edge have no complete neighbourhood
    const bool at_edge = strip.cell_row == 0 ||
                         (strip.cell_row + 1) * FloorView::kCell + kHaloReach > raw.rows ||
                         strip.begin_px < kHaloReach || strip.end_px + kHaloReach > raw.cols;
    for (int k = 0; k < FloorView::kCell && at_edge; ++k)
      for (int x = strip.begin_px, y = strip.cell_row * FloorView::kCell + k; x < strip.end_px; ++x)
        raw(y, x) = strength(y, x) != 0 ? 1 : 0;
  }
  dropHalos(strips.data(), strips.size(), layout, strength.data, raw.data);
}

void Despeckler::clean(const BitArea& area, const BitMask& raw, BitMask& cleaned) {
  takeMedian(area, raw, median_);
  regrowCorners(area, raw, median_, cleaned);
  clear(area, median_);
}

}  // namespace omnifleet::ground
