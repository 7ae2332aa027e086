#include "ground/despeckler.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kHalo = 8;  // of the squared distance from floor: √8 times weaker than the strongest neighbour
constexpr int kMajority = 13;  // of the 25 pixels of a 5×5 median

}  // namespace

Despeckler::Despeckler(cv::Size image)
    : median_(image, std::uint8_t{0}),
      strongest_(image, std::uint8_t{0}),
      column_sums_(static_cast<std::size_t>(image.width) + 8) {}

void Despeckler::trimHalos(const std::vector<Strip>& strips, cv::Mat1b& strength, cv::Mat1b& scratch) {
  constexpr int kReach = 2;
  const auto larger = [](std::uint8_t a, std::uint8_t b) { return std::max(a, b); };
  const auto smaller = [](std::uint8_t a, std::uint8_t b) { return std::min(a, b); };
  joinAlong<kReach>(strips, strength, median_, true, larger);
  joinAlong<kReach>(strips, median_, strongest_, false, larger);
  joinAlong<kReach>(strips, strength, median_, true, smaller);
  joinAlong<kReach>(strips, median_, scratch, false, smaller);
  for (const auto& strip : strips) {
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
      std::uint8_t* raw = strength.ptr(y);
      const std::uint8_t *strong = strongest_.ptr(y), *weak = scratch.ptr(y);
      for (int x = strip.begin_px; x < strip.end_px; ++x) {
        const bool halo = raw[x] < strong[x] / kHalo && weak[x] == 0;
        raw[x] = raw[x] != 0 && !halo ? 1 : 0;
      }
    }
  }
}

void Despeckler::takeMedian(const std::vector<Strip>& strips, const cv::Mat1b& mask) {
  const int width = mask.cols, height = mask.rows;
  for (const auto& strip : strips) {
    const int begin = std::max(strip.begin_px, 2), end = std::min(strip.end_px, width - 2);
    for (int y = std::max(strip.cell_row * kCell, 2); y < std::min((strip.cell_row + 1) * kCell, height - 2);
         ++y) {
      const std::uint8_t *a = mask.ptr(y - 2), *b = mask.ptr(y - 1), *c = mask.ptr(y), *d = mask.ptr(y + 1),
                         *e = mask.ptr(y + 2);
      std::uint8_t* sums = column_sums_.data();
      for (int x = begin - 2; x < end + 2; ++x)
        sums[x] = static_cast<std::uint8_t>(a[x] + b[x] + c[x] + d[x] + e[x]);
      std::uint8_t* out = median_.ptr(y);
      for (int x = begin; x < end; ++x)
        out[x] = sums[x - 2] + sums[x - 1] + sums[x] + sums[x + 1] + sums[x + 2] >= kMajority ? 255 : 0;
    }
  }
}

void Despeckler::clean(const std::vector<Strip>& strips, const cv::Mat1b& raw, cv::Mat1b& cleaned) {
  takeMedian(strips, raw);
  const int width = raw.cols, height = raw.rows;
  for (const auto& strip : strips) {
    const int begin = std::max(strip.begin_px, 1), end = std::min(strip.end_px, width - 1);
    for (int y = std::max(strip.cell_row * kCell, 1); y < std::min((strip.cell_row + 1) * kCell, height - 1);
         ++y) {
      const std::uint8_t *a = median_.ptr(y - 1), *b = median_.ptr(y), *c = median_.ptr(y + 1),
                         *mask = raw.ptr(y);
      std::uint8_t* sums = column_sums_.data();
      for (int x = begin - 1; x < end + 1; ++x) sums[x] = a[x] | b[x] | c[x];
      std::uint8_t* out = cleaned.ptr(y);
      for (int x = begin; x < end; ++x) {
        const auto near = static_cast<std::uint8_t>(sums[x - 1] | sums[x] | sums[x + 1]);
        out[x] = static_cast<std::uint8_t>((near & (mask[x] != 0 ? 255 : 0)) | b[x]);
      }
    }
  }
}

}  // namespace omnifleet::ground
