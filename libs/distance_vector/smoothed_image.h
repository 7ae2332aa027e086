#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::distance_vector {

/// The image in three planes, each smoothed with the binomial filter [1 2 1]² / 16. It reduces pixel noise by
/// 2.7 and keeps edges within 2 px. Values are grey levels times 16. Buffers are reused.
class SmoothedImage {
 public:
  static constexpr float kScale = 1.0f / 16.0f;

  /// @param bgr CV_8UC3, at least 3×3 pixels
  void compute(const cv::Mat& bgr);

  cv::Size size() const { return size_; }
  /// Row of one channel: 0 blue, 1 green, 2 red.
  const std::uint16_t* row(int channel, int v) const {
    return planes_[channel].data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(size_.width);
  }
  cv::Vec3f colour(int u, int v) const {
    return {kScale * static_cast<float>(row(0, v)[u]), kScale * static_cast<float>(row(1, v)[u]),
            kScale * static_cast<float>(row(2, v)[u])};
  }

 private:
  cv::Size size_;
  std::vector<std::uint16_t> planes_[3];
  std::vector<std::uint16_t> across_[3];  ///< rows smoothed in u, a ring of three rows per channel
};

}  // namespace omnifleet::distance_vector
