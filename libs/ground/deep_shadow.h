#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/appearance_class.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Finds where a region's shadow is deepest, and measures whether it ends like the side of an object or like
/// a shadow.
class DeepShadow {
 public:
  explicit DeepShadow(cv::Size image) {
    rows_.reserve(static_cast<std::size_t>(image.height));
    columns_.reserve(static_cast<std::size_t>(image.width));
  }

  /// Share of the outline (0 to 1) that ends in an intensity step, as a side does at its vertical edges and
  /// its top. Shadows fade instead.
  float sharpShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances);
  /// Share of the outline towards the camera's foot that ends in an intensity step, as the foot of a wall
  /// does. Vignetting makes the floor fade instead.
  float footShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances);
  /// Brightness at the foot of a side. Brighter pixels belong to the shadow on the floor before it.
  Appearance foot(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances);

 private:
  bool find(const Blob& blob, const cv::Mat1b& appearances);
  template <typename Visit>
  void forEnds(const Blob& blob, Visit visit) const;

  /// First and last pixel of the deep shadow in a row or column of the region's rectangle; last < 0: none.
  struct Extent {
    int first, last;
  };
  std::vector<Extent> rows_, columns_;
  float depth_ = 0.0f;                     ///< depth of the shadow: 1 − brightness / floor brightness
  std::vector<float> profile_;             ///< brightness along a bearing
  std::vector<float> feet_, before_feet_;  ///< per bearing: middle of the step, and brightness before it
};

}  // namespace omnifleet::ground
