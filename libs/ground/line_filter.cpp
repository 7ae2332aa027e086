#include "ground/line_filter.h"

#include <algorithm>
#include <utility>

#include "ground/strip_joins.h"

namespace omnifleet::ground {

LineFilter::LineFilter(cv::Size image, int width_px)
    : radius_(std::min(width_px / 2, kMaxWidth_px / 2)),
      a_(image, std::uint8_t{0}),
      b_(image, std::uint8_t{0}) {}

void LineFilter::apply(const std::vector<Strip>& strips, cv::Mat1b& mask) {
  if (radius_ < 1) return;
  // Masks are 0 or 255, so that the smallest is "all" and the largest "any".
  smallestAround(radius_, strips, mask, a_);
  largestAround(radius_, strips, a_, b_);
  cv::Mat1b *core = &b_, *grown = &a_;
  for (int step = 1; step < radius_; ++step, std::swap(core, grown)) growWithin(strips, *core, mask, *grown);
  growWithin(strips, *core, mask, mask);
  clearStrips(strips, a_);
  clearStrips(strips, b_);
}

}  // namespace omnifleet::ground
