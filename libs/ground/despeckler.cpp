#include "ground/despeckler.h"

#include <algorithm>

#include "geometry/wide.h"
#include "ground/strip_joins.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kHalo = 8;  // of the squared distance from floor: √8 times weaker than the strongest neighbour
constexpr int kMajority = 13;  // of the 25 pixels of a 5×5 median

OMNIFLEET_WIDE void dropHalos(const Strip* strips, std::size_t count, const cv::Mat1b& strongest,
                              const cv::Mat1b& weakest, cv::Mat1b& strength) {
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = strip->begin_px, end = strip->end_px, top = strip->cell_row * kCell;
    for (int y = top; y < top + kCell; ++y) {
      std::uint8_t* raw = strength.ptr(y);
      const std::uint8_t *strong = strongest.ptr(y), *weak = weakest.ptr(y);
#pragma GCC ivdep
      for (int x = begin; x < end; ++x) {
        const bool halo = (raw[x] < strong[x] / kHalo) & (weak[x] == 0);
        raw[x] = (raw[x] != 0) & !halo ? 1 : 0;
      }
    }
  }
}

OMNIFLEET_WIDE void takeMedian(const Strip* strips, std::size_t count, const cv::Mat1b& mask,
                               std::uint8_t* sums, cv::Mat1b& median) {
  const int width = mask.cols, height = mask.rows;
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = std::max(strip->begin_px, 2), end = std::min(strip->end_px, width - 2);
    for (int y = std::max(strip->cell_row * kCell, 2);
         y < std::min((strip->cell_row + 1) * kCell, height - 2); ++y) {
      const std::uint8_t *a = mask.ptr(y - 2), *b = mask.ptr(y - 1), *c = mask.ptr(y), *d = mask.ptr(y + 1),
                         *e = mask.ptr(y + 2);
#pragma GCC ivdep
      for (int x = begin - 2; x < end + 2; ++x)
        sums[x] = static_cast<std::uint8_t>(a[x] + b[x] + c[x] + d[x] + e[x]);
      std::uint8_t* out = median.ptr(y);
#pragma GCC ivdep
      for (int x = begin; x < end; ++x) {
        const auto sum =
            static_cast<std::uint8_t>(sums[x - 2] + sums[x - 1] + sums[x] + sums[x + 1] + sums[x + 2]);
        out[x] = sum >= kMajority ? 255 : 0;
      }
    }
  }
}

OMNIFLEET_WIDE void regrowCorners(const Strip* strips, std::size_t count, const cv::Mat1b& raw,
                                  const cv::Mat1b& median, std::uint8_t* sums, cv::Mat1b& cleaned) {
  const int width = raw.cols, height = raw.rows;
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = std::max(strip->begin_px, 1), end = std::min(strip->end_px, width - 1);
    for (int y = std::max(strip->cell_row * kCell, 1);
         y < std::min((strip->cell_row + 1) * kCell, height - 1); ++y) {
      const std::uint8_t *a = median.ptr(y - 1), *b = median.ptr(y), *c = median.ptr(y + 1),
                         *mask = raw.ptr(y);
#pragma GCC ivdep
      for (int x = begin - 1; x < end + 1; ++x) sums[x] = static_cast<std::uint8_t>(a[x] | b[x] | c[x]);
      std::uint8_t* out = cleaned.ptr(y);
#pragma GCC ivdep
      for (int x = begin; x < end; ++x) {
        const auto near = static_cast<std::uint8_t>(sums[x - 1] | sums[x] | sums[x + 1]);
        const std::uint8_t set = mask[x] != 0 ? 255 : 0;
        out[x] = static_cast<std::uint8_t>((near & set) | b[x]);
      }
    }
  }
}

}  // namespace

Despeckler::Despeckler(cv::Size image)
    : median_(image, std::uint8_t{0}),
      strongest_(image, std::uint8_t{0}),
      column_sums_(static_cast<std::size_t>(image.width) + 8) {}

void Despeckler::trimHalos(const std::vector<Strip>& strips, cv::Mat1b& strength, cv::Mat1b& scratch) {
  constexpr int kReach = 2;
  largestAlong(Along::kRows, kReach, strips, strength, median_);
  largestAlong(Along::kColumns, kReach, strips, median_, strongest_);
  smallestAlong(Along::kRows, kReach, strips, strength, median_);
  smallestAlong(Along::kColumns, kReach, strips, median_, scratch);
  dropHalos(strips.data(), strips.size(), strongest_, scratch, strength);
}

void Despeckler::clean(const std::vector<Strip>& strips, const cv::Mat1b& raw, cv::Mat1b& cleaned) {
  takeMedian(strips.data(), strips.size(), raw, column_sums_.data(), median_);
  regrowCorners(strips.data(), strips.size(), raw, median_, column_sums_.data(), cleaned);
}

}  // namespace omnifleet::ground
