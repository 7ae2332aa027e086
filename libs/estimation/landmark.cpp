#include "estimation/landmark.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {

void Shape::Sums::reset() {
  w.assign(kDirections, 0.0);
  wa.assign(kDirections, 0.0);
  wq.assign(kDirections, 0.0);
}

void Shape::Sums::add(const View& view, const Pose2& landmark_from_base, double height_m, double size,
                      const Shape* reference) {
  constexpr double kOutlier_m = 0.02;  // deviation from the present shape at which a view counts half
  if (w.empty()) reset();
  const int k = static_cast<int>(view.b_m.size());
  if (k < 3) return;
  const Eigen::Vector2d foot = landmark_from_base * view.foot_m;
  const double inverse = inverseScale(height_m, view.camera_height_m);
  const TurnedGrid corners(-landmark_from_base.theta_rad, kDirections, k);
  for (int m = 0; m < kDirections; ++m) {
    const auto at = static_cast<std::size_t>(m);
    const double phi = 2.0 * M_PI * m / kDirections;
    const Corner corner = corners.at(m);
    const auto i = static_cast<std::size_t>(corner.i), j = static_cast<std::size_t>(corner.j);
    if (view.sigma_m[i] <= 0 || view.sigma_m[j] <= 0) continue;
    const double b = corner.wi * view.b_m[i] + corner.wj * view.b_m[j];
    const double sigma = std::max(view.sigma_m[i], view.sigma_m[j]) * (b > 0 ? inverse : 1.0);
    const double a = b + std::cos(phi) * foot.x() + std::sin(phi) * foot.y();
    const double q = b > 0 && view.camera_height_m > 0 ? b / view.camera_height_m : 0.0;
    double weight = 1.0 / (sigma * sigma);
    if (reference != nullptr && reference->known(m)) {
      weight /= 1.0 + std::pow((a - height_m * q - reference->support(m, height_m)) / kOutlier_m, 2);
    }
    w[at] += weight;
    wa[at] += weight * a / size;
    wq[at] += weight * q;
  }
}

void Shape::freeze(const View& view, const Pose2& landmark_from_base, double height_m, double size) {
  frozen_.add(view, landmark_from_base, height_m, size, empty() ? nullptr : this);
}

void Shape::begin(double size) {
  size_ = size;
  if (frozen_.w.empty()) frozen_.reset();
  sums_ = frozen_;
}

void Shape::add(const View& view, const Pose2& landmark_from_base, double height_m) {
  sums_.add(view, landmark_from_base, height_m, size_, empty() ? nullptr : this);
}

void Shape::finish() {
  a_.assign(kDirections, 0.0);
  q_.assign(kDirections, 0.0);
  weight_ = sums_.w;
  for (std::size_t m = 0; m < kDirections; ++m) {
    if (weight_[m] <= 0) continue;
    a_[m] = size_ * sums_.wa[m] / weight_[m];
    q_[m] = sums_.wq[m] / weight_[m];
  }
}

bool Shape::partly(Eigen::Vector2d& at, Eigen::Vector2d& by_height, double& width,
                   double& width_by_height) const {
  const auto known_ones = std::count_if(weight_.begin(), weight_.end(), [](double w) { return w > 0; });
  if (empty() || known_ones * 10 >= kDirections * 9) return false;
  PartialOutline outline;
  Eigen::Vector3d sums = Eigen::Vector3d::Zero(), sums_by_height = Eigen::Vector3d::Zero();
  for (int m = 0; m < kDirections; ++m) {
    if (!known(m)) continue;
    const double phi = 2.0 * M_PI * m / kDirections;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    outline.add(n);
    sums += a(m) * PartialOutline::row(n);
    sums_by_height += q(m) * PartialOutline::row(n);
  }
  return outline.solve(sums, at, width) && outline.solve(sums_by_height, by_height, width_by_height);
}

void Shape::centre(Eigen::Vector2d& at, Eigen::Vector2d& by_height) const {
  double width = 0.0, width_by_height = 0.0;
  if (partly(at, by_height, width, width_by_height)) return;
  at.setZero();
  by_height.setZero();
  for (int m = 0; m < kDirections && !empty(); ++m) {
    const double phi = 2.0 * M_PI * m / kDirections;
    const Eigen::Vector2d n = Eigen::Vector2d(std::cos(phi), std::sin(phi)) * (2.0 / kDirections);
    at += a(m) * n;
    by_height += q(m) * n;
  }
}

void Shape::halfWidth(double& at, double& by_height) const {
  Eigen::Vector2d centre, centre_by_height;
  if (partly(centre, centre_by_height, at, by_height)) return;
  at = by_height = 0.0;
  for (int m = 0; m < kDirections && !empty(); ++m) {
    at += a(m) / kDirections;
    by_height += q(m) / kDirections;
  }
}

}  // namespace omnifleet::estimation
