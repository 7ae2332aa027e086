#pragma once

#include <opencv2/core.hpp>

#include "ground/bit_mask.h"

namespace omnifleet::ground {

/// Takes floor markings (grid lines, joints) out of a mask: opening by a square of side `width_px`, then what
/// was rounded off the remaining regions grows back within the mask, by half that width. A line next to an
/// object leaves a stub of that length.
class LineFilter {
 public:
  static constexpr int kMaxWidth_px = 17;

  /// @param width_px structures thinner than this go (odd numbers 3–kMaxWidth_px; less: nothing is done)
  LineFilter(cv::Size image, int width_px);

  /// @param mask not set outside the area
  void apply(const BitArea& area, BitMask& mask);

 private:
  int radius_;
  BitMask a_, b_;
};

}  // namespace omnifleet::ground
