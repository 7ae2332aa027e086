#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "synthetic/scene.h"

namespace omnifleet::synthetic {

/// Converts light to grey levels: blur, brightness-dependent noise, rounding. Light has a resolution of 1/64
/// grey level.
class Sensor {
 public:
  static constexpr int kScale = 64;

  explicit Sensor(const ImageFormation& image);

  /// `light` is CV_16UC3. Zero values stay black (outside the image circle). `frame_seed` determines the
  /// noise.
  void develop(const cv::Mat& light, std::uint32_t frame_seed, cv::Mat& bgr);

 private:
  ImageFormation image_;
  cv::Mat blurred_;
  std::vector<std::int16_t> normal_;  ///< normal deviates, unit 1/256
  std::vector<std::int32_t> sigma_;   ///< σ per 4 grey levels, unit 1/64 grey level
};

}  // namespace omnifleet::synthetic
