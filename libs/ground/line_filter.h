#pragma once

#include <opencv2/core.hpp>

#include "ground/bit_mask.h"

namespace omnifleet::ground {

/// Removes floor markings (grid lines, joints) from a mask. The mask is opened by a square of side
/// `width_px`. The remaining regions then regrow within the mask by half that width, which restores their
/// corners. A line next to an object leaves a stub of that length.
class LineFilter {
 public:
  static constexpr int kMaxWidth_px = 17;

  /// @param width_px thinner structures are removed (odd, 3–kMaxWidth_px; smaller: the filter is off)
  LineFilter(cv::Size image, int width_px);

  /// @param mask not set outside the area
  void apply(const BitArea& area, BitMask& mask);

 private:
  int radius_;
  BitMask a_, b_;
};

}  // namespace omnifleet::ground
