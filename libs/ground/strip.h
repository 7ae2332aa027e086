#pragma once

#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Pixel columns [begin_px, end_px) of one row of cells, in which pixels are classified one by one. All other
/// pixels are plain floor.
struct Strip {
  int cell_row;
  int begin_px, end_px;
};

/// Sets a full-resolution mask to 0 on the strips.
inline void clearStrips(const std::vector<Strip>& strips, cv::Mat1b& mask) {
  constexpr int kPiece_px =
      16;  // most strips are a few pieces long; one memset of variable size per row costs more
  for (const auto& s : strips) {
    std::uint8_t* row = mask.ptr(s.cell_row * FloorView::kCell);
    for (int k = 0; k < FloorView::kCell; ++k, row += mask.step1()) {
      int x = s.begin_px;
      for (; x + kPiece_px <= s.end_px; x += kPiece_px) std::memset(row + x, 0, kPiece_px);
      if (x < s.end_px) std::memset(row + x, 0, static_cast<std::size_t>(s.end_px - x));
    }
  }
}

}  // namespace omnifleet::ground
