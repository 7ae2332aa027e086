#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/pose2.h"

namespace omnifleet {

/// Twist (x, y, θ) that leads along an arc from here to the pose in unit time: the logarithm of SE(2).
inline Eigen::Vector3d logarithm(const Pose2& pose) {
  // Translation part V⁻¹·t with V the integral of the rotation.
  const double half = 0.5 * pose.theta_rad;
  const double cot = std::abs(half) < 1e-9 ? 1.0 : half / std::tan(half);
  return {cot * pose.x_m + half * pose.y_m, -half * pose.x_m + cot * pose.y_m, pose.theta_rad};
}

}  // namespace omnifleet
