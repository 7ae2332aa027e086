#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Standard deviations of equal colours, grey levels. The texture of a floor (fibres, dirt) changes its
/// brightness from pixel to pixel, but hardly its hue. A camera's noise affects both.
struct FloorNoise {
  double channel = 0.0;  ///< of one channel
  double hue = 0.0;      ///< of one channel of the hue, without the brightness
  FloorNoise operator/(double by) const { return {channel / by, hue / by}; }
};

/// Measures the noise of single pixels on the seed cells.
class NoiseMeter {
 public:
  explicit NoiseMeter(const FloorView& view);
  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  /// @param cell_means CV_32FC3
  FloorNoise measure(const cv::Mat& image, const cv::Mat3f& cell_means);

 private:
  struct Variances {
    float channel, hue;
  };
  static Variances varianceOf(const cv::Mat& image, const cv::Point& cell, const cv::Vec3f& mean);

  std::vector<cv::Point> cells_;
  std::vector<float> variances_, hue_variances_;
};

}  // namespace omnifleet::ground
