#pragma once

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::ground {

/// The hull of the largest part of a mask, where that part fills it: what is thinner than a square of
/// 2 · radius + 1 pixels is left out. Reads and writes nothing beyond the rectangle told; buffers live from
/// call to call.
class ConvexPart {
 public:
  /// @param radius_px 1 or 2
  explicit ConvexPart(cv::Size image, int radius_px = 2);

  /// @param mask 255 where it is set, else 0 or 1, of the size told; @param within where it is looked at
  /// @param min_solid share of its hull that the part fills
  /// @return false where there is none
  bool find(const cv::Mat1b& mask, const cv::Rect& within, double min_solid);

  /// Pixels, in the image; until the next call.
  const std::vector<cv::Point>& hull() const { return hull_; }

 private:
  void open(const cv::Mat1b& mask, const cv::Rect& within);
  void flood(const cv::Point& seed, const cv::Rect& within);
  void measureRows(const cv::Rect& within);
  int filledArea() const;

  struct Extent {
    int first, last;
    void take(int at) {
      first = std::min(first, at);
      last = std::max(last, at);
    }
  };
  int radius_px_;
  cv::Mat1b along_, eroded_, firm_;
  std::vector<cv::Point> queue_, largest_, corners_, hull_;
  std::vector<Extent> rows_, columns_;  ///< of the largest part
};

}  // namespace omnifleet::ground
