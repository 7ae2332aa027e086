#pragma once

#include "observation/observation.h"

namespace omnifleet::tracking {

/// One blob seen from one place: its supports, and where the camera stood in `odom`.
struct View {
  TimeNs time_ns = 0;
  SupportFunction supports;                          ///< directions measured in that frame's base_link
  Eigen::Vector2d foot_m = Eigen::Vector2d::Zero();  ///< foot of the camera in odom
  double heading_rad = 0.0;                          ///< of base_link in odom
  double camera_height_m = 0.0;

  std::size_t size() const { return supports.size(); }
  bool usable(std::size_t k) const {
    return std::isfinite(supports.b_m[k]) && std::isfinite(supports.sigma_m[k]) && supports.sigma_m[k] > 0.0F;
  }
  /// Direction k in odom, radians.
  double angle(std::size_t k) const {
    return heading_rad + 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(size());
  }
};

/// How far something went over the floor between two views.
struct Displacement {
  bool valid = false;
  Eigen::Vector2d moved_m = Eigen::Vector2d::Zero();  ///< odom axes
  double sigma_m = 0.0;                               ///< of its length (the worse axis)
  double rms_m = 0.0;                                 ///< of what a pure shift leaves over
};

/// Displacement from the contact side alone (b < 0 in both views): there the silhouette is the footprint
/// itself, whatever its height (docs/methods.md, prism: the prediction is g where g < 0), so that h_P,now(n)
/// − h_P,then(n) = n·Δ is linear and needs no height. Directions where either view is unusable are left out;
/// invalid with fewer than 12.
/// @param drift of odom between both (OwnMotion::driftSince)
Displacement contactDisplacement(const View& then, const View& now, const Pose2& drift = {});

}  // namespace omnifleet::tracking
