#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace omnifleet {

/// Angle in (−π, π]. Input and output in radians.
inline double wrapAngle(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * M_PI);
  return wrapped <= -M_PI ? wrapped + 2.0 * M_PI : wrapped;
}

/// A pose or transform in the plane (SE(2)), metres and radians, REP-103: x forward, y left, θ
/// counter-clockwise. Named `target_from_source`: `map_from_base * point_in_base` is a point in `map`, and
/// `map_from_base * base_from_camera` is `map_from_camera`.
struct Pose2 {
  double x_m = 0.0;
  double y_m = 0.0;
  double theta_rad = 0.0;

  Eigen::Vector2d translation() const { return {x_m, y_m}; }
  Eigen::Matrix2d rotation() const { return Eigen::Rotation2Dd(theta_rad).toRotationMatrix(); }
  Eigen::Vector3d vector() const { return {x_m, y_m, theta_rad}; }
  static Pose2 fromVector(const Eigen::Vector3d& v) { return {v.x(), v.y(), wrapAngle(v.z())}; }

  Pose2 inverse() const {
    const double c = std::cos(theta_rad), s = std::sin(theta_rad);
    return {-c * x_m - s * y_m, s * x_m - c * y_m, wrapAngle(-theta_rad)};
  }
  bool isFinite() const { return std::isfinite(x_m) && std::isfinite(y_m) && std::isfinite(theta_rad); }
};

inline Eigen::Vector2d operator*(const Pose2& a_from_b, const Eigen::Vector2d& p_in_b) {
  const double c = std::cos(a_from_b.theta_rad), s = std::sin(a_from_b.theta_rad);
  return {a_from_b.x_m + c * p_in_b.x() - s * p_in_b.y(), a_from_b.y_m + s * p_in_b.x() + c * p_in_b.y()};
}

inline Pose2 operator*(const Pose2& a_from_b, const Pose2& b_from_c) {
  const Eigen::Vector2d t = a_from_b * b_from_c.translation();
  return {t.x(), t.y(), wrapAngle(a_from_b.theta_rad + b_from_c.theta_rad)};
}

/// Covariance of `a_from_b * b_from_c` (3×3 over x, y, θ of the right increment). The covariance of each
/// factor is given in its own source frame (right perturbation, first order).
Eigen::Matrix3d composeCovariance(const Eigen::Matrix3d& cov_ab, const Pose2& b_from_c,
                                  const Eigen::Matrix3d& cov_bc);

/// R = Rz(yaw)·Ry(pitch)·Rx(roll), angles in degrees (the order of `rotation_rpy_deg`).
Eigen::Matrix3d rotationFromRpyDeg(const Eigen::Vector3d& rpy_deg);

}  // namespace omnifleet
