#include "ground/line_filter.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;

std::uint8_t both(std::uint8_t a, std::uint8_t b) {
  return static_cast<std::uint8_t>(a & b);
}
std::uint8_t either(std::uint8_t a, std::uint8_t b) {
  return static_cast<std::uint8_t>(a | b);
}

}  // namespace

LineFilter::LineFilter(cv::Size image, int width_px)
    : radius_(width_px / 2), a_(image, std::uint8_t{0}), b_(image, std::uint8_t{0}) {}

template <typename Join>
void LineFilter::along(const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out, bool rows,
                       int radius, Join join) {
  const int margin = radius;
  for (const auto& strip : strips) {
    const int begin = std::max(strip.begin_px, margin), end = std::min(strip.end_px, in.cols - margin);
    const int top = std::max(strip.cell_row * kCell, margin);
    const int bottom = std::min((strip.cell_row + 1) * kCell, in.rows - margin);
    for (int y = top; y < bottom; ++y) {
      std::uint8_t* to = out.ptr(y);
      const std::uint8_t* first = rows ? in.ptr(y) - radius : in.ptr(y - radius);
      std::copy(first + begin, first + end, to + begin);
      for (int k = -radius + 1; k <= radius; ++k) {
        const std::uint8_t* from = rows ? in.ptr(y) + k : in.ptr(y + k);
        for (int x = begin; x < end; ++x) to[x] = join(to[x], from[x]);
      }
    }
  }
}

void LineFilter::growBack(const std::vector<Strip>& strips, const cv::Mat1b& mask, cv::Mat1b& core,
                          cv::Mat1b& buffer) {
  for (int step = 0; step < radius_; ++step) {
    along(strips, core, buffer, true, 1, either);
    along(strips, buffer, core, false, 1, either);
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
  along(strips, mask, a_, true, radius_, both);
  along(strips, a_, b_, false, radius_, both);
  along(strips, b_, a_, true, radius_, either);
  along(strips, a_, b_, false, radius_, either);
  growBack(strips, mask, b_, a_);
  for (const auto& strip : strips) {
    const cv::Rect rect(strip.begin_px, strip.cell_row * kCell, strip.end_px - strip.begin_px, kCell);
    b_(rect).copyTo(mask(rect));
  }
  clearStrips(strips, a_);
  clearStrips(strips, b_);
}

}  // namespace omnifleet::ground
