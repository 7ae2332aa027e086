#include "estimation/camera_error.h"

#include <cmath>

namespace omnifleet::estimation {

CameraOptions CameraOptions::read(const options::Section& section) {
  CameraOptions o;
  section.read("estimate", o.estimate);
  section.read("focal_sigma", o.focal_sigma, {1e-6, 0.2});
  section.read("height_sigma", o.height_sigma, {1e-6, 0.2});
  section.read("tilt_sigma_rad", o.tilt_sigma_rad, {1e-6, 0.2});
  section.read("contour_sigma_rad", o.contour_sigma_rad, {1e-7, 0.2});
  section.finish();
  return o;
}

CameraError CameraOptions::sigma() const {
  if (!estimate) return CameraError::Constant(1e-9);
  CameraError sigma;
  sigma << focal_sigma, height_sigma, tilt_sigma_rad, tilt_sigma_rad, contour_sigma_rad;
  return sigma;
}

Eigen::Matrix<double, 2, 4> cameraField(const Eigen::Vector2d& p_m, double camera_height_m) {
  if (!(camera_height_m > 0)) return Eigen::Matrix<double, 2, 4>::Zero();  // a laser has none of these
  const double rho = p_m.norm(), u = rho / camera_height_m;
  // H·(1 + u²)·atan(u)/ρ, whose limit at the foot is 1.
  const double radial = u > 1e-6 ? (1.0 + u * u) * std::atan(u) / u : 1.0;
  Eigen::Matrix<double, 2, 4> field;
  field.col(0) = -radial * p_m;
  field.col(1) = p_m;
  field.col(2) = Eigen::Vector2d(0.0, camera_height_m) + p_m * (p_m.y() / camera_height_m);
  field.col(3) = -(Eigen::Vector2d(camera_height_m, 0.0) + p_m * (p_m.x() / camera_height_m));
  return field;
}

double contourField(const Eigen::Vector2d& p_m, const Eigen::Vector2d& normal, double camera_height_m) {
  if (!(camera_height_m > 0)) return 0.0;
  const double rho = p_m.norm(), u = rho / camera_height_m;
  if (u < 1e-6) return camera_height_m;
  const Eigen::Vector2d along = p_m / rho;
  const double radial = normal.dot(along) * camera_height_m * (1.0 + u * u);
  const double across =
      (along.x() * normal.y() - along.y() * normal.x()) * camera_height_m * u / std::atan(u);
  return std::hypot(radial, across);
}

}  // namespace omnifleet::estimation
