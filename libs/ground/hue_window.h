#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/labelling.h"

namespace omnifleet::ground {

/// 1/n for n < kCount, 0 for 0: a division for each pixel would cost more than all else there.
template <std::size_t kCount>
constexpr std::array<float, kCount> sharesUpTo() {
  std::array<float, kCount> shares{};
  for (std::size_t n = 1; n < kCount; ++n) shares[n] = 1.0f / static_cast<float>(n);
  return shares;
}

/// Mean colours of what a region shows around each of its pixels, run by run from the top: the sums of the
/// columns are kept from row to row, so that a pixel costs the same however wide the window is.
class HueWindow {
 public:
  static constexpr int kAround_px = 2;        ///< to each side of a pixel
  static constexpr std::uint8_t kCounts = 2;  ///< bit of a mark

  /// Of the pixels of a window that count, 16 bits each from the lowest: blue, green, red, how many.
  using Sum = std::uint64_t;

  explicit HueWindow(int image_width);

  /// A region begins: nothing is kept from before.
  void begin();
  /// Calls see(x, sum) for each pixel of a run, from the left. Rows must not come again.
  /// @param image BGR8. @param marks those with kCounts do; while a region lasts this must not change
  template <typename See>
  void slide(const Run& run, const cv::Mat& image, const cv::Mat1b& marks, See see) {
    addColumns(run, image, marks);
    const Column* column = columns_.data() + kAround_px;
    Sum sum = 0;
    for (int x = run.begin - kAround_px; x < run.begin + kAround_px; ++x) sum += column[x].sum;
    for (int x = run.begin; x < run.end; ++x) {
      sum += column[x + kAround_px].sum;
      see(x, sum);
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
    std::int64_t row = 0;  ///< about which it was summed, counted on from region to region
  };
  void addColumns(const Run& run, const cv::Mat& image, const cv::Mat1b& marks);

  static constexpr int kSide_px = 2 * kAround_px + 1;
  static constexpr auto kShares = sharesUpTo<kSide_px * kSide_px + 1>();

  std::vector<Column> columns_;  ///< of the image, with kAround_px more to each side that stay empty
  std::int64_t first_row_ = 0;   ///< what the image's row 0 is counted as in this region
};

}  // namespace omnifleet::ground
