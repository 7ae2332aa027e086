#pragma once

#include <opencv2/core.hpp>

#include "ground/floor_noise.h"
#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Mean colour per cell, and its noise.
struct CellColours {
  const cv::Mat3f& means;  ///< CV_32FC3
  FloorNoise noise;        ///< of one cell's mean
  bool is_smoothed;        ///< hues are averages of several cells, so a mixed edge looks like a gradient
};

/// Sigma filter for the hue of cell means. In dim light noise hides the hue of a single cell. The filter
/// averages the hue over the neighbouring cells that differ by no more than noise, so that edges stay sharp.
/// The brightness is unchanged. Source: J.-S. Lee, Digital image smoothing and the sigma filter, CVGIP 24,
/// 1983.
class HueSmoother {
 public:
  explicit HueSmoother(const FloorView& view);

  /// @param means means of the view's cells
  /// @param pixel noise of the seeds' pixels
  /// @param tolerated hue tolerance as a share of the floor's brightness
  /// @return refers to `means` or to memory of this object; valid until the next call
  CellColours smooth(const cv::Mat3f& means, const FloorNoise& pixel, double tolerated);

 private:
  bool isNoisy(const cv::Mat3f& means, const FloorNoise& cell, double tolerated) const;
  void smoothRow(const cv::Mat3f& means, int y, float most_off2);

  const FloorView* view_;
  cv::Mat3f smoothed_;
};

}  // namespace omnifleet::ground
