#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lens/camera.h"

namespace omnifleet::bench {

/// Maps a whole frame backward to a plan of the floor, 4 mm per pixel, centred at the camera's foot. The
/// place in the frame of every plan pixel is computed once.
class FloorRemap {
 public:
  static constexpr double kMetresPerPixel = 0.004;

  FloorRemap(const lens::Camera& camera, const cv::Size& plan_px);

  void apply(const cv::Mat3b& frame, cv::Mat3b& plan) const;
  /// Masks of the plan. seen: 255 where the floor is in view. seed: 255 in the ring around the robot, 0.30 to
  /// 0.45 m from the foot, that is assumed to be floor.
  const cv::Mat1b& seen() const { return seen_; }
  const cv::Mat1b& seed() const { return seed_; }

  /// Floor points are metres in base_link, plan points are pixels.
  Eigen::Vector2d planFromFloor(const Eigen::Vector2d& point_m) const;
  Eigen::Vector2d floorFromPlan(const Eigen::Vector2d& pixel) const;

 private:
  Eigen::Vector2d foot_m_, middle_px_;
  cv::Mat map_, map_fraction_;
  cv::Mat1b seen_, seed_;
};

}  // namespace omnifleet::bench
