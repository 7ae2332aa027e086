#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::ground {

/// Sums over the 5×5 pixels around each pixel of a rectangle, per channel. Buffers are kept between calls.
class PatchSums {
 public:
  static constexpr int kRadius_px = 2, kPixels = (2 * kRadius_px + 1) * (2 * kRadius_px + 1);

  explicit PatchSums(cv::Size image);

  /// @param image BGR8 of the constructor's size @param rect at least kRadius_px away from its edges
  void read(const cv::Mat& image, const cv::Rect& rect);

  cv::Vec3f mean(int x, int y) const {
    const auto& sum = sums_(y, x);
    constexpr float kShare = 1.0f / static_cast<float>(kPixels);
    return {kShare * static_cast<float>(sum[0]), kShare * static_cast<float>(sum[1]),
            kShare * static_cast<float>(sum[2])};
  }

 private:
  cv::Mat_<cv::Vec<std::uint16_t, 3>> sums_;
  std::vector<std::uint16_t> column_;  ///< sums of five rows, per channel
};

}  // namespace omnifleet::ground
