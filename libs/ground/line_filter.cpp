#include "ground/line_filter.h"

#include <algorithm>

#include "geometry/wide.h"
#include "ground/strip_joins.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;

/// Masks are 0 or 255, so that the smallest is "all" and the largest "any".
void open(const std::vector<Strip>& strips, const cv::Mat1b& mask, int radius, cv::Mat1b& buffer,
          cv::Mat1b& opened) {
  smallestAlong(Along::kRows, radius, strips, mask, buffer);
  smallestAlong(Along::kColumns, radius, strips, buffer, opened);
  largestAlong(Along::kRows, radius, strips, opened, buffer);
  largestAlong(Along::kColumns, radius, strips, buffer, opened);
}

OMNIFLEET_WIDE void keepWithin(const Strip* strips, std::size_t count, const cv::Mat1b& allowed,
                               cv::Mat1b& mask) {
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = strip->begin_px, end = strip->end_px, top = strip->cell_row * kCell;
    for (int y = top; y < top + kCell; ++y) {
      const std::uint8_t* keep = allowed.ptr(y);
      std::uint8_t* to = mask.ptr(y);
#pragma GCC ivdep
      for (int x = begin; x < end; ++x) to[x] = static_cast<std::uint8_t>(to[x] & keep[x]);
    }
  }
}

}  // namespace

LineFilter::LineFilter(cv::Size image, int width_px)
    : radius_(std::min(width_px / 2, kMaxWidth_px / 2)),
      a_(image, std::uint8_t{0}),
      b_(image, std::uint8_t{0}) {}

void LineFilter::growBack(const std::vector<Strip>& strips, const cv::Mat1b& mask, cv::Mat1b& core,
                          cv::Mat1b& buffer) {
  for (int step = 0; step < radius_; ++step) {
    largestAlong(Along::kRows, 1, strips, core, buffer);
    largestAlong(Along::kColumns, 1, strips, buffer, core);
    keepWithin(strips.data(), strips.size(), mask, core);
  }
}

void LineFilter::apply(const std::vector<Strip>& strips, cv::Mat1b& mask) {
  if (radius_ < 1) return;
  open(strips, mask, radius_, a_, b_);
  growBack(strips, mask, b_, a_);
  for (const auto& strip : strips) {
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y)
      std::copy(b_.ptr(y) + strip.begin_px, b_.ptr(y) + strip.end_px, mask.ptr(y) + strip.begin_px);
  }
  clearStrips(strips, a_);
  clearStrips(strips, b_);
}

}  // namespace omnifleet::ground
