#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Columns [begin, end) of one row of cells whose pixels are looked at; everything else is plain floor.
struct Strip {
  int cell_row;
  int begin_px, end_px;
};

/// Sets a full-resolution mask to 0 on the strips.
inline void clearStrips(const std::vector<Strip>& strips, cv::Mat1b& mask) {
  constexpr int kCell = FloorView::kCell;
  for (const auto& s : strips)
    mask(cv::Rect(s.begin_px, s.cell_row * kCell, s.end_px - s.begin_px, kCell)).setTo(0);
}

/// out = join over the 2·kRadius + 1 neighbours along rows or columns, on the strips.
template <int kRadius, typename Join>
void joinAlong(const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out, bool rows, Join join) {
  const std::ptrdiff_t step = rows ? 1 : static_cast<std::ptrdiff_t>(in.step1());
  for (const auto& strip : strips) {
    const int begin = std::max(strip.begin_px, kRadius), end = std::min(strip.end_px, in.cols - kRadius);
    const int top = std::max(strip.cell_row * FloorView::kCell, kRadius);
    const int bottom = std::min((strip.cell_row + 1) * FloorView::kCell, in.rows - kRadius);
    for (int y = top; y < bottom; ++y) {
      const std::uint8_t* from = in.ptr(y);
      std::uint8_t* to = out.ptr(y);
      for (int x = begin; x < end; ++x) {
        std::uint8_t value = from[x];
        for (int k = 1; k <= kRadius; ++k) value = join(value, join(from[x - k * step], from[x + k * step]));
        to[x] = value;
      }
    }
  }
}

}  // namespace omnifleet::ground
