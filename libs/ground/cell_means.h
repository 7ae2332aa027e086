#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Mean colour of every cell. This is the only pass over all pixels of a frame; later stages read pixels only
/// where objects are.
class CellMeans {
 public:
  explicit CellMeans(const FloorView& view);

  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  void read(const cv::Mat& image);
  /// Mean colour of each cell within the view, CV_32FC3 (grey: three equal channels); 0 elsewhere.
  const cv::Mat3f& means() const { return means_; }

 private:
  void average(const cv::Mat& image, int cell_row);

  const FloorView* view_;
  cv::Mat3f means_;
  std::vector<std::uint16_t> columns_;  ///< of a row of cells: sum of each pixel column
};

}  // namespace omnifleet::ground
