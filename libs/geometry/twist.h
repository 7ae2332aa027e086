#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/pose2.h"

namespace omnifleet {

/// Logarithm of SE(2): the constant twist (x, y, θ) that reaches `pose` in unit time.
inline Eigen::Vector3d logarithm(const Pose2& pose) {
  // Translation part V⁻¹·t, where V is the integral of the rotation.
  const double half = 0.5 * pose.theta_rad;
  const double cot = std::abs(half) < 1e-9 ? 1.0 : half / std::tan(half);
  return {cot * pose.x_m + half * pose.y_m, -half * pose.x_m + cot * pose.y_m, pose.theta_rad};
}

/// exp(f·log(motion)): a fraction of a motion at constant twist. The fraction may exceed 1.
inline Pose2 fractionOf(const Pose2& motion, double fraction) {
  const double theta = motion.theta_rad;
  const Eigen::Vector3d twist = logarithm(motion);
  const double angle = fraction * theta;
  const double a = std::abs(theta) < 1e-9 ? fraction : std::sin(angle) / theta;
  const double b = std::abs(theta) < 1e-9 ? 0.0 : (1.0 - std::cos(angle)) / theta;
  return {a * twist.x() - b * twist.y(), b * twist.x() + a * twist.y(), angle};
}

}  // namespace omnifleet
