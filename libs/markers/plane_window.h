#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"

namespace omnifleet::markers {

/// Points of the plane of the markers under a window of the image, by bicubic interpolation between 4 × 4
/// pixels at which the lens is evaluated. A marker is small compared with the focal length, so the error is
/// some micrometres.
class PlaneWindow {
 public:
  /// Evaluates the lens for a window. Points are given in the frame of this pose. False unless the plane is
  /// visible in all of the window.
  bool set(const lens::Camera& camera, double height_m, const cv::Rect& window, const Pose2& map_from_frame);
  /// Writes the points under the pixels of a row of the window, metres.
  void row(int v, float* x_m, float* y_m);
  /// Metres per pixel in the middle of the window: columns are the motions for one pixel right and down.
  const Eigen::Matrix2d& scale() const { return scale_; }

 private:
  static constexpr int kNodes = 4;
  struct Weights {
    double value[kNodes], slope[kNodes];
  };
  static Weights weights(const double (&nodes)[kNodes], double at);

  int width_ = 0;
  std::vector<float> columns_[kNodes];  ///< weight of each node per column
  double u_[kNodes], v_[kNodes];
  Eigen::Vector2d nodes_[kNodes][kNodes];
  Eigen::Matrix2d scale_ = Eigen::Matrix2d::Identity();
};

}  // namespace omnifleet::markers
