#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "markers/colour_table.h"

namespace omnifleet::markers {

/// A horizontal run of pixels of one class: columns [begin, end) of a row.
struct Run {
  int row = 0, begin = 0, end = 0;
  std::uint8_t colour = 0;
  int blob = -1;
};

/// An 8-connected region of one class; or an object: a region of all classes and mixtures.
struct Blob {
  std::uint8_t colour = 0;  ///< class; 0 for an object
  int area_px = 0;
  int left = 0, top = 0, right = 0, bottom = 0;  ///< inclusive
  double sum_x = 0.0, sum_y = 0.0;               ///< sums of the pixels' coordinates

  double x() const { return sum_x / area_px; }  ///< of the centroid
  double y() const { return sum_y / area_px; }
};

/// Run-length labelling with union–find; buffers are reused between images.
class BlobFinder {
 public:
  /// Blobs of at least min_area_px in a BGR image, ordered from top to bottom by their first pixel.
  const std::vector<Blob>& find(const cv::Mat& bgr, const ColourTable& table, int min_area_px);
  /// Blobs within these windows, which may overlap. A blob that reaches an inner edge of a window is
  /// excluded, because it may continue beyond. All other blobs equal those of the whole image.
  const std::vector<Blob>& find(const cv::Mat& bgr, const ColourTable& table, int min_area_px,
                                const std::vector<cv::Rect>& windows);
  /// Objects of at least min_area_px in the image of the last find(), in the same order.
  const std::vector<Blob>& objects(int min_area_px);

 private:
  void separate(const std::vector<cv::Rect>& windows);
  void scan(const cv::Mat& bgr, const ColourTable& table);
  void scanRow(const cv::Mat& bgr, const ColourTable& table, int y, int begin, int end);
  bool isWhole(const Blob& blob) const;
  void connect(bool any_class);
  template <typename Wanted>
  void collect(const Wanted& wanted, std::vector<Blob>& blobs);
  int root(int run);

  std::vector<cv::Rect> windows_;  ///< disjoint, left to right
  std::vector<Run> runs_;
  std::vector<int> row_begin_, parent_;
  std::vector<Blob> all_, blobs_, objects_;
  cv::Size image_;
};

}  // namespace omnifleet::markers
