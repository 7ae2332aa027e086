#pragma once

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::ground {

/// Convex hull of the largest part of a mask, if that part fills its hull. Parts thinner than a square of
/// 2·radius + 1 pixels are ignored. Reads and writes only within the given rectangle. Buffers are reused
/// between calls.
class ConvexPart {
 public:
  /// @param radius_px 1 or 2
  explicit ConvexPart(cv::Size image, int radius_px = 2);

  /// @param mask 255 where set, else 0 or 1; size as given to the constructor
  /// @param within rectangle to search
  /// @param min_solid minimum share of the hull that the part fills
  /// @return false if there is no such part
  bool find(const cv::Mat1b& mask, const cv::Rect& within, double min_solid);

  /// Hull in image pixels; valid until the next call.
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
