#pragma once

#include <Eigen/Core>

#include "dataset/markers.h"
#include "markers/patch_finder.h"
#include "markers/sub_pixel.h"

namespace omnifleet::markers {

/// Refines the pose of a pair by least squares on the coverage of every pixel of both patches. The model is
/// two rectangles of known size at known places on the robot, blurred by the pixel. All eight edges determine
/// the heading, also where the image border cuts a patch. The line between the centres (Choi et al. 2014
/// §V.2) depends on only two points.
class RectangleFit {
 public:
  RectangleFit(const dataset::MarkerSet& markers, const FinderOptions& options);

  /// Replaces pose and covariance. False (not a marker) if the two rectangles do not fit the image, or if the
  /// fit moves by more than 1.5 pixels (half a patch diagonal if one is cut).
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
