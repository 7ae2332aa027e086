#pragma once

#include "observation/observation.h"

namespace omnifleet::tracking {

/// One blob seen from one place: its supports, and the camera's place in `odom`.
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

/// Displacement of an object over the floor between two views.
struct Displacement {
  bool valid = false;
  Eigen::Vector2d moved_m = Eigen::Vector2d::Zero();  ///< odom axes
  double sigma_m = 0.0;                               ///< of its length (the worse axis), metres
  double rms_m = 0.0;                                 ///< residual after a pure shift
};

/// Displacement from the contact side alone (b < 0 in both views). There the silhouette is the footprint
/// itself at any height (docs/methods/local_mapper.md), so that h_P,now(n) − h_P,then(n) = n·Δ is linear and
/// needs no height. Directions where either view is unusable are omitted. Invalid with fewer than 12
/// directions.
/// @param drift of odom between both views (OwnMotion::driftSince)
Displacement contactDisplacement(const View& then, const View& now, const Pose2& drift = {});

}  // namespace omnifleet::tracking
