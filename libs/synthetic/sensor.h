#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "synthetic/scene.h"

namespace omnifleet::synthetic {

/// Light to grey levels: blur, noise that depends on the brightness, rounding. Light is kept in 1/64 grey
/// level.
class Sensor {
 public:
  static constexpr int kScale = 64;

  explicit Sensor(const ImageFormation& image);

  /// `light` is CV_16UC3; pixels that are wholly zero stay black (outside the
  /// image circle). `frame_seed` decides the noise.
  void develop(const cv::Mat& light, std::uint32_t frame_seed, cv::Mat& bgr);

 private:
  ImageFormation image_;
  cv::Mat blurred_;
  std::vector<std::int16_t> normal_;  ///< normal deviates, 1/256
  std::vector<std::int32_t> sigma_;   ///< per 4 grey levels, 1/64 grey level, ×256
};

}  // namespace omnifleet::synthetic
