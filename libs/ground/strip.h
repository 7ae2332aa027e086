#pragma once

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

}  // namespace omnifleet::ground
