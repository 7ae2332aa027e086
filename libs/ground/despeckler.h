#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/strip.h"

namespace omnifleet::ground {

/// Cleans a mask: returns mixed pixels along outlines to the floor, takes the 5×5 median and regrows corners.
/// Buffers are reused.
class Despeckler {
 public:
  explicit Despeckler(cv::Size image) : median_(image) {}

  /// @param strength distance of each pixel from floor (0: floor)
  /// @param raw output, 0 or 1, without halos. A halo pixel is far weaker than its neighbours and next to
  /// floor, so it is a mixed pixel. Without this step narrow gaps between objects would close.
  static void trimHalos(const std::vector<Strip>& strips, const cv::Mat1b& strength, cv::Mat1b& raw);

  /// @param cleaned pixels with most of their 5×5 neighbourhood set, and pixels that touch these and were set
  /// before. The median alone would round corners by one pixel.
  void clean(const BitArea& area, const BitMask& raw, BitMask& cleaned);

 private:
  BitMask median_;
};

}  // namespace omnifleet::ground
