#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_frame.h"
#include "ground/labelling.h"
#include "ground/look.h"

namespace omnifleet::ground {

/// Where a region's shade is deepest, and how it ends there: as the side of a thing or as a shadow.
class DeepShade {
 public:
  explicit DeepShade(cv::Size image) {
    rows_.reserve(static_cast<std::size_t>(image.height));
    columns_.reserve(static_cast<std::size_t>(image.width));
  }

  /// Share of the outline that ends in a step (0 to 1), as a side does at verticals and at its top, not as
  /// shadows fade.
  float sharpShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks);
  /// Share of the outline towards the camera's foot that ends in a step, as a wall's foot does, not where the
  /// lens shows the floor in less and less light.
  float footShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks);
  /// How light it is at the foot of a side: what is lighter is the shadow on the floor before it.
  Look foot(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks);

 private:
  bool find(const Blob& blob, const cv::Mat1b& looks);
  template <typename Visit>
  void forEnds(const Blob& blob, Visit visit) const;

  /// First and last pixel of the deep shade in a row or column of a region's rectangle; last < 0: none.
  struct Extent {
    int first, last;
  };
  std::vector<Extent> rows_, columns_;
  float depth_ = 0.0f;                     ///< of that shade: what it is darker than the floor, as a share
  std::vector<float> profile_;             ///< brightness along a bearing
  std::vector<float> feet_, before_feet_;  ///< by bearings: halfway up the step there; before it
};

}  // namespace omnifleet::ground
