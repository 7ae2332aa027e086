#pragma once

#include <Eigen/Core>

#include "dataset/markers.h"
#include "markers/patch_finder.h"
#include "markers/sub_pixel.h"

namespace omnifleet::markers {

/// Sharpens a pair's pose by least squares on the coverage of every pixel of both patches: the model is two
/// rectangles of known size at known places on the robot, blurred by the pixel. All eight edges speak for the
/// heading, also where the image's border cuts a patch; the line between the centres (Choi et al. 2014 §V.2)
/// rests on two points only.
class RectangleFit {
 public:
  RectangleFit(const dataset::MarkerSet& markers, const FinderOptions& options);

  /// Replaces pose and covariance. False where the two rectangles do not explain what is seen, or the fit
  /// strays by more than a pixel (half a patch where one is cut): no marker.
  bool refine(const Patch& team, const Patch& individual, Detection& detection) const;

 private:
  struct Normal {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    double squares = 0.0;
    std::size_t count = 0;
  };
  void accumulate(const Patch& patch, const Eigen::Vector2d& offset_m, const Pose2& map_from_base,
                  double blur_m, Normal& normal) const;

  Eigen::Vector2d team_m_, individual_m_, half_m_;
  FinderOptions options_;
};

}  // namespace omnifleet::markers
