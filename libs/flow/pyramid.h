#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::flow {

/// Grey image pyramid, each level half the size of the one before; buffers are reused.
class Pyramid {
 public:
  explicit Pyramid(int levels = 4) : levels_(static_cast<std::size_t>(levels)) {}

  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied
  void build(const cv::Mat& image);
  int size() const { return static_cast<int>(levels_.size()); }
  const cv::Mat1b& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }
  const cv::Mat1b& grey() const { return levels_.front(); }

 private:
  std::vector<cv::Mat1b> levels_;
};

}  // namespace omnifleet::flow
