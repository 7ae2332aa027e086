#include "observation/camera_error.h"

#include <algorithm>
#include <cmath>

namespace omnifleet {

Eigen::Matrix<double, 2, 4> cameraField(const Eigen::Vector2d& p_m, double camera_height_m,
                                        const lens::Spread& lens) {
  if (!(camera_height_m > 0)) return Eigen::Matrix<double, 2, 4>::Zero();  // no camera error for a laser
  const double rho = p_m.norm(), u = rho / camera_height_m, theta = std::atan(u);
  // H·(1 + u²)·(r/r′)/ρ. Its limit at the foot of the camera is 1.
  const double radial = u > 1e-6 ? (1.0 + u * u) * lens.radius(theta) / lens.slope(theta) / u : 1.0;
  Eigen::Matrix<double, 2, 4> field;
  field.col(0) = -radial * p_m;
  field.col(1) = p_m;
  field.col(2) = Eigen::Vector2d(0.0, camera_height_m) + p_m * (p_m.y() / camera_height_m);
  field.col(3) = -(Eigen::Vector2d(camera_height_m, 0.0) + p_m * (p_m.x() / camera_height_m));
  return field;
}

double contourField(const Eigen::Vector2d& p_m, const Eigen::Vector2d& normal, double camera_height_m,
                    const lens::Spread& lens) {
  if (!(camera_height_m > 0)) return 0.0;
  const double rho = p_m.norm(), u = rho / camera_height_m, theta = std::atan(u);
  if (u < 1e-6) return camera_height_m;
  const Eigen::Vector2d along = p_m / rho;
  const double radial = normal.dot(along) * camera_height_m * (1.0 + u * u) / lens.slope(theta);
  const double across =
      (along.x() * normal.y() - along.y() * normal.x()) * camera_height_m * u / lens.radius(theta);
  return std::hypot(radial, across);
}

CameraError supportByCameraError(const SupportTriple& b, std::size_t direction, std::size_t directions,
                                 double camera_height_m, const lens::Spread& lens) {
  const double step = 2.0 * M_PI / static_cast<double>(directions);
  double slope = 0.0;  // db/dφ: the supporting point is b·n + b′·n⊥
  int sides = 0;
  if (!std::isnan(b.after_m)) slope += (b.after_m - b.here_m * std::cos(step)) / std::sin(step), ++sides;
  if (!std::isnan(b.before_m)) slope += (b.here_m * std::cos(step) - b.before_m) / std::sin(step), ++sides;
  slope /= std::max(1, sides);
  const double phi = step * static_cast<double>(direction);
  const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), across(-n.y(), n.x());
  const Eigen::Vector2d p = b.here_m * n + slope * across;
  CameraError derivative;
  derivative << (n.transpose() * cameraField(p, camera_height_m, lens)).transpose(),
      contourField(p, n, camera_height_m, lens);
  return derivative;
}

}  // namespace omnifleet
