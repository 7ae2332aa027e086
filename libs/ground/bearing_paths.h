#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// The floor along evenly spaced bearings, as the image shows it: from the own body outwards, in steps of
/// about one pixel. Computed once from the lens. Places between steps are fractions of a step.
class BearingPaths {
 public:
  struct Path {
    int begin = 0, count = 0;  ///< of the steps
  };

  /// @param end_rad from straight down @throws options::Error if no bearing shows floor
  BearingPaths(const lens::Camera& camera, const FloorView& view, int bearings, double end_rad);

  std::size_t size() const { return paths_.size(); }
  const Path& operator[](std::size_t bearing) const { return paths_[bearing]; }
  /// Nearest pixel of a step.
  const cv::Point& pixel(const Path& path, int step) const {
    return nearest_[static_cast<std::size_t>(path.begin + step)];
  }
  /// 1/m of the floor at a place. @param at in [0, count − 1)
  float inverseAt(const Path& path, double at) const;
  /// 1/m per step, at a place.
  float slopeAt(const Path& path, double at) const;
  /// The place of an inverse range; clamped to the path.
  double placeOf(const Path& path, float inverse_m) const;
  /// Colour at a place, between pixels; grey images have three equal channels. `at` is clamped to the path.
  cv::Vec3f colour(const cv::Mat& image, const Path& path, double at) const;

 private:
  std::vector<Path> paths_;
  std::vector<cv::Point2f> pixel_;  ///< of each step
  std::vector<cv::Point> nearest_;  ///< likewise, rounded
  std::vector<float> inverse_;      ///< 1/m, of each step
};

}  // namespace omnifleet::ground
