#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Colours right above the horizon, by bearing from the camera's foot. No pixel there shows floor.
class Horizon {
 public:
  static constexpr int kSectors = 72;  ///< per turn

  Horizon(const lens::Camera& camera, const FloorView& floor_view);

  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  void read(const cv::Mat& image);
  /// Per cell: 1 + its sector; 0 outside the view.
  const cv::Mat1b& sectors() const { return sectors_; }
  /// Cells of a sector (counted from 1) that lie just below the horizon.
  const std::vector<cv::Point>& edge(int sector) const { return edge_[static_cast<std::size_t>(sector)]; }
  /// Mean colours by sector number (grey: three equal channels). Negative where nothing is visible;
  /// colours()[0] always is.
  const std::vector<cv::Vec4f>& colours() const { return colours_; }

 private:
  void findEdge(const lens::Camera& camera, const FloorView& floor_view);
  void findPixels(const lens::Camera& camera);

  cv::Mat1b sectors_;
  std::vector<std::vector<cv::Point>> edge_, pixels_;  ///< by sector, from 1
  std::vector<cv::Vec4f> colours_;
};

}  // namespace omnifleet::ground
