#include "ground/line_filter.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;

constexpr auto both = [](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(a & b); };
constexpr auto either = [](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(a | b); };

template <int kRadius>
void open(const std::vector<Strip>& strips, const cv::Mat1b& mask, cv::Mat1b& buffer, cv::Mat1b& opened) {
  joinAlong<kRadius>(strips, mask, buffer, true, both);
  joinAlong<kRadius>(strips, buffer, opened, false, both);
  joinAlong<kRadius>(strips, opened, buffer, true, either);
  joinAlong<kRadius>(strips, buffer, opened, false, either);
}

/// The opening by a square of any side, built from the fixed ones.
void open(const std::vector<Strip>& strips, const cv::Mat1b& mask, int radius, cv::Mat1b& buffer,
          cv::Mat1b& opened) {
  switch (radius) {
    case 1:
      return open<1>(strips, mask, buffer, opened);
    case 2:
      return open<2>(strips, mask, buffer, opened);
    case 3:
      return open<3>(strips, mask, buffer, opened);
    case 4:
      return open<4>(strips, mask, buffer, opened);
    case 5:
      return open<5>(strips, mask, buffer, opened);
    case 6:
      return open<6>(strips, mask, buffer, opened);
    case 7:
      return open<7>(strips, mask, buffer, opened);
    default:
      return open<8>(strips, mask, buffer, opened);
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
    joinAlong<1>(strips, core, buffer, true, either);
    joinAlong<1>(strips, buffer, core, false, either);
    for (const auto& strip : strips) {
      for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
        const std::uint8_t* allowed = mask.ptr(y);
        std::uint8_t* to = core.ptr(y);
        for (int x = strip.begin_px; x < strip.end_px; ++x) to[x] = both(to[x], allowed[x]);
      }
    }
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
