#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/labelling.h"

namespace omnifleet::ground {

/// Reciprocals 1/n for n < kCount, and 0 for n = 0. A division per pixel would dominate the cost.
template <std::size_t kCount>
constexpr std::array<float, kCount> sharesUpTo() {
  std::array<float, kCount> shares{};
  for (std::size_t n = 1; n < kCount; ++n) shares[n] = 1.0f / static_cast<float>(n);
  return shares;
}

/// Mean colour of a region around each of its pixels, run by run from the top. The column sums are kept from
/// row to row, so that the cost per pixel does not depend on the window size.
class HueWindow {
 public:
  static constexpr int kAround_px = 2;        ///< pixels on each side of a pixel
  static constexpr std::uint8_t kCounts = 2;  ///< bit of a mark: the pixel counts

  /// Sum over the counting pixels of a window, 16 bits each from the lowest: blue, green, red, number of
  /// pixels.
  using Sum = std::uint64_t;

  explicit HueWindow(int image_width);

  /// Begins a new region and discards older sums.
  void begin();
  /// Calls visit(x, sum) for each pixel of a run from the left. Each row may be visited only once.
  /// @param image BGR8
  /// @param marks pixels with kCounts count; must not change while a region is processed
  template <typename Visit>
  void slide(const Run& run, const cv::Mat& image, const cv::Mat1b& marks, Visit visit) {
    addColumns(run, image, marks);
    const Column* column = columns_.data() + kAround_px;
    Sum sum = 0;
    for (int x = run.begin - kAround_px; x < run.begin + kAround_px; ++x) sum += column[x].sum;
    for (int x = run.begin; x < run.end; ++x) {
      sum += column[x + kAround_px].sum;
      visit(x, sum);
      sum -= column[x - kAround_px].sum;
    }
  }

  static int count(Sum sum) { return static_cast<int>(sum >> 48); }
  static cv::Vec3f mean(Sum sum) {
    const float share = kShares[static_cast<std::size_t>(count(sum))];
    const auto of = [&](int k) { return share * static_cast<float>((sum >> (16 * k)) & 0xffffu); };
    return {of(0), of(1), of(2)};
  }

 private:
  struct Column {
    Sum sum = 0;
    std::int64_t row = 0;  ///< centre row of the sum, counted over all regions
  };
  void addColumns(const Run& run, const cv::Mat& image, const cv::Mat1b& marks);

  static constexpr int kSide_px = 2 * kAround_px + 1;
  static constexpr auto kShares = sharesUpTo<kSide_px * kSide_px + 1>();

  std::vector<Column> columns_;  ///< columns of the image plus kAround_px empty ones on each side
  std::int64_t first_row_ = 0;   ///< number of the image's row 0 in this region
};

}  // namespace omnifleet::ground
