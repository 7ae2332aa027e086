#pragma once

#include <cstring>
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
  for (const auto& s : strips) {
    std::uint8_t* row = mask.ptr(s.cell_row * FloorView::kCell) + s.begin_px;
    for (int k = 0; k < FloorView::kCell; ++k, row += mask.step1())
      std::memset(row, 0, static_cast<std::size_t>(s.end_px - s.begin_px));
  }
}

}  // namespace omnifleet::ground
