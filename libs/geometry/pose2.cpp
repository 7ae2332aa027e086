#include "geometry/pose2.h"

namespace omnifleet {

Eigen::Matrix3d composeCovariance(const Eigen::Matrix3d& cov_ab, const Pose2& b_from_c,
                                  const Eigen::Matrix3d& cov_bc) {
  // (T_ab exp(e1)) (T_bc exp(e2)) ≈ T_ac exp(Ad(T_bc⁻¹) e1 + e2).
  const Eigen::Matrix2d r_cb = b_from_c.rotation().transpose();
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = r_cb;
  adjoint.topRightCorner<2, 1>() = r_cb * Eigen::Vector2d(-b_from_c.y_m, b_from_c.x_m);
  return adjoint * cov_ab * adjoint.transpose() + cov_bc;
}

Eigen::Matrix3d rotationFromRpyDeg(const Eigen::Vector3d& rpy_deg) {
  const Eigen::Vector3d rpy = rpy_deg * (M_PI / 180.0);
  return (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace omnifleet
