#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lens/camera.h"

namespace omnifleet::bench {

/// Backward mapping of a whole frame to a plan of the floor, of 4 mm a pixel around the camera's foot: for
/// every pixel of the plan a place in the frame, computed once.
class FloorRemap {
 public:
  static constexpr double kMetresPerPixel = 0.004;

  FloorRemap(const lens::Camera& camera, const cv::Size& plan_px);

  void apply(const cv::Mat3b& frame, cv::Mat3b& plan) const;
  /// 255 where the camera sees the floor, and within the ring around the robot that is taken for floor.
  const cv::Mat1b& seen() const { return seen_; }
  const cv::Mat1b& seed() const { return seed_; }

  Eigen::Vector2d planFromFloor(const Eigen::Vector2d& point_m) const;
  Eigen::Vector2d floorFromPlan(const Eigen::Vector2d& pixel) const;

 private:
  Eigen::Vector2d foot_m_, middle_px_;
  cv::Mat map_, map_fraction_;
  cv::Mat1b seen_, seed_;
};

}  // namespace omnifleet::bench
