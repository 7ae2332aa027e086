#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::markers {

/// Points of the plane of the markers under a window of the image, by bicubic interpolation between 4 × 4
/// pixels at which the lens is evaluated. A marker is small compared with the focal length, so the error is
/// some micrometres.
class PlaneWindow {
 public:
  /// Evaluates the lens for a window. False unless the plane is visible in all of it.
  bool set(const lens::Camera& camera, double height_m, const cv::Rect& window);
  /// Selects a row of the window, in pixels of the image.
  void setRow(double v);
  /// For the row of the last setRow(): the point under column u, map.
  Eigen::Vector2d at(int u) const {
    const Weights& w = columns_[static_cast<std::size_t>(u - left_)];
    return w.value[0] * row_[0] + w.value[1] * row_[1] + w.value[2] * row_[2] + w.value[3] * row_[3];
  }
  /// Metres per pixel in the middle of the window: columns are the motions for one pixel right and down.
  const Eigen::Matrix2d& scale() const { return scale_; }

 private:
  static constexpr int kNodes = 4;
  struct Weights {
    double value[kNodes], slope[kNodes];
  };
  static Weights weights(const double (&nodes)[kNodes], double at);

  int left_ = 0;
  std::vector<Weights> columns_;
  double u_[kNodes], v_[kNodes];
  Eigen::Vector2d nodes_[kNodes][kNodes], row_[kNodes];
  Eigen::Matrix2d scale_ = Eigen::Matrix2d::Identity();
};

}  // namespace omnifleet::markers
