#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::flow {

/// Grey image pyramid, each level half the size of the one before: bit by bit what cv::pyrDown gives, at a
/// third of its time, and only where it is asked for. Buffers are reused.
class Pyramid {
 public:
  explicit Pyramid(int levels = 4) : levels_(static_cast<std::size_t>(levels)) {}

  /// All of an image.
  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied
  void build(const cv::Mat& image);
  /// What lies in some rectangles within the image; a level needs two pixels of the one below around its own,
  /// so that the coarser ones reach less far (lossOf()). Elsewhere the levels keep what they held.
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where);
  /// Pixels of the finest level by which the coarsest of so many may hold less, to each side that is not the
  /// image's.
  static int lossOf(int levels) { return 3 * ((1 << (levels - 1)) - 1); }

  int size() const { return static_cast<int>(levels_.size()); }
  const cv::Mat1b& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }
  const cv::Mat1b& grey() const { return levels_.front(); }

 private:
  void create(cv::Size size);
  cv::Rect halve(const cv::Mat1b& fine, const cv::Rect& where, cv::Mat1b& coarse);

  std::vector<cv::Mat1b> levels_;
  std::vector<std::uint8_t> even_, odd_;  ///< pixels of a row
  std::vector<std::uint16_t> rows_;       ///< the last five, smoothed
};

}  // namespace omnifleet::flow
