#pragma once

// Mean colours of the cells of an image, computed pixel by pixel.

#include <opencv2/core.hpp>
#include <vector>

#include "flow/pyramid.h"

namespace omnifleet::flow::testing {

class Cells {
 public:
  /// @param image CV_8UC1 or CV_8UC3
  explicit Cells(const cv::Mat& image)
      : means_(image.rows / CellColours::kSide, image.cols / CellColours::kSide),
        known_(static_cast<std::size_t>(means_.rows), cv::Range(0, means_.cols)) {
    constexpr int kSide = CellColours::kSide;
    for (int y = 0; y < means_.rows; ++y) {
      for (int x = 0; x < means_.cols; ++x) {
        const cv::Scalar mean = cv::mean(image(cv::Rect(x * kSide, y * kSide, kSide, kSide)));
        for (int c = 0; c < 3; ++c) means_(y, x)[c] = static_cast<float>(mean[image.channels() == 3 ? c : 0]);
      }
    }
  }
  CellColours colours() const { return {means_, known_}; }
  std::vector<cv::Range>& known() { return known_; }

 private:
  cv::Mat3f means_;
  std::vector<cv::Range> known_;
};

}  // namespace omnifleet::flow::testing
