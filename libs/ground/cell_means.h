#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// The one look at every pixel of a frame: what else is done with pixels is done where there are objects.
class CellMeans {
 public:
  explicit CellMeans(const FloorView& view);

  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  void read(const cv::Mat& image);
  /// Mean colour of each cell that the view covers, CV_32FC3 (grey: three equal channels); elsewhere 0.
  const cv::Mat3f& means() const { return means_; }

 private:
  void average(const cv::Mat& image, int cell_row);

  const FloorView* view_;
  cv::Mat3f means_;
  std::vector<std::uint16_t> columns_;  ///< of a row of cells: sums of each column's pixels
};

}  // namespace omnifleet::ground
