#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/strip.h"

namespace omnifleet::ground {

/// Cleans a mask: mixed pixels along outlines go back to the floor, 5×5 median, corners regrown. Buffers are
/// reused.
class Despeckler {
 public:
  explicit Despeckler(cv::Size image) : median_(image) {}

  /// @param strength how much "not floor" each pixel is (0: floor)
  /// @param raw 0/1, without the halos: what is far weaker than its neighbours and next to floor is a mixed
  ///   pixel, else narrow gaps between objects close
  static void trimHalos(const std::vector<Strip>& strips, const cv::Mat1b& strength, cv::Mat1b& raw);

  /// @param cleaned most of the 5×5 neighbourhood set, and what touches that and was set before (the median
  ///   rounds corners by a pixel)
  void clean(const BitArea& area, const BitMask& raw, BitMask& cleaned);

 private:
  BitMask median_;
};

}  // namespace omnifleet::ground
