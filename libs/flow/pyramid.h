#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::flow {

/// Grey image pyramid, each level half the size of the one before: bit by bit what cv::pyrDown gives, at a
/// third of its time. Buffers are reused.
class Pyramid {
 public:
  explicit Pyramid(int levels = 4) : levels_(static_cast<std::size_t>(levels)) {}

  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied
  void build(const cv::Mat& image);
  /// Likewise from what base() holds: brightness, CV_8UC1.
  void build();
  cv::Mat1b& base() { return levels_.front(); }
  int size() const { return static_cast<int>(levels_.size()); }
  const cv::Mat1b& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }
  const cv::Mat1b& grey() const { return levels_.front(); }

 private:
  void halve(const cv::Mat1b& fine, cv::Mat1b& coarse);

  std::vector<cv::Mat1b> levels_;
  std::vector<std::uint8_t> even_, odd_;  ///< pixels of a row
  std::vector<std::uint16_t> rows_;       ///< the last five, smoothed
};

}  // namespace omnifleet::flow
