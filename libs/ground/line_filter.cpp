#include "ground/line_filter.h"

#include <algorithm>
#include <utility>

#include "ground/bit_ops.h"

namespace omnifleet::ground {

LineFilter::LineFilter(cv::Size image, int width_px)
    : radius_(std::min(width_px / 2, kMaxWidth_px / 2)), a_(image), b_(image) {
  static_assert(kMaxWidth_px / 2 <= kMaxReach);
}

void LineFilter::apply(const BitArea& area, BitMask& mask) {
  if (radius_ < 1) return;
  erode(area, radius_, mask, a_);
  dilate(area, radius_, a_, b_);
  BitMask *core = &b_, *grown = &a_;
  for (int step = 1; step < radius_; ++step, std::swap(core, grown)) growWithin(area, *core, mask, *grown);
  growWithin(area, *core, mask, mask);
  clear(area, a_);
  clear(area, b_);
}

}  // namespace omnifleet::ground
