#pragma once

#include <Eigen/Core>

#include "dataset/markers.h"
#include "markers/patch_finder.h"
#include "markers/sub_pixel.h"

namespace omnifleet::markers {

/// Sharpens a pair's pose by least squares on the coverage of every pixel of both patches: the model is two
/// rectangles of known size at known places on the robot, blurred by the pixel. All eight edges speak for the
/// heading, where the line between the centres (Choi et al. 2014 §V.2) rests on two points.
class RectangleFit {
 public:
  RectangleFit(const dataset::MarkerSet& markers, double pixel_sigma_px);

  /// Replaces pose and covariance; leaves the detection as it is where the fit strays by more than a pixel.
  void refine(const Patch& team, const Patch& individual, Detection& detection) const;

 private:
  struct Normal {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
  };
  void accumulate(const Patch& patch, const Eigen::Vector2d& offset_m, const Pose2& map_from_base,
                  double blur_m, Normal& normal) const;

  Eigen::Vector2d team_m_, individual_m_, half_m_;
  double pixel_sigma_px_;
};

}  // namespace omnifleet::markers
