#pragma once

#include <opencv2/core.hpp>

#include "ground/floor_noise.h"
#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Mean colour per cell, and how far the noise of pixels puts it off.
struct CellColours {
  const cv::Mat3f& means;  ///< CV_32FC3
  FloorNoise noise;        ///< of one cell's mean
  bool is_smoothed;        ///< hues are those of several cells: what is mixed at an edge looks like a slope
};

/// In dim light the noise hides the hue of a cell's mean. Smooths it over the cells beside it that may have
/// the same: those that differ from it by no more than noise does (the sigma filter, J.-S. Lee, Digital image
/// smoothing and the sigma filter, CVGIP 24, 1983), so that edges stay. Brightness is left as it is.
class HueSmoother {
 public:
  explicit HueSmoother(const FloorView& view);

  /// @param means of the view's cells @param pixel noise of the seeds' pixels @param tolerated share of the
  /// floor's brightness by which hues may be off
  /// @return what refers to `means`, or to memory of this object until the next call
  CellColours smooth(const cv::Mat3f& means, const FloorNoise& pixel, double tolerated);

 private:
  bool isNoisy(const cv::Mat3f& means, const FloorNoise& cell, double tolerated) const;
  void smoothRow(const cv::Mat3f& means, int y, float most_off2);

  const FloorView* view_;
  cv::Mat3f smoothed_;
};

}  // namespace omnifleet::ground
