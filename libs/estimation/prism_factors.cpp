#include "estimation/prism_factors.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::estimation {
namespace {
constexpr double kCauchy = 2.0;  // in σ: residual at which a direction counts half
constexpr double kHalf = 0.2;  // u₀, in σ² of a contour: clean outlines leave 0.01 to 0.1, odd ones 1 to 50

Eigen::Vector2d unit(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}
/// `v` turned by the angle of the unit vector `by`.
Eigen::Vector2d turned(const Eigen::Vector2d& by, const Eigen::Vector2d& v) {
  return {by.x() * v.x() - by.y() * v.y(), by.y() * v.x() + by.x() * v.y()};
}
Eigen::Vector2d normalTo(const Eigen::Vector2d& v) {
  return {-v.y(), v.x()};
}
}  // namespace

PrismFactor::PrismFactor(std::shared_ptr<const View> view, int directions, int object_dimension)
    : view_(std::move(view)) {
  const int k = static_cast<int>(view_->b_m.size());
  const int stride = std::max(1, k / std::max(1, directions));
  for (int i = 0; i < k; i += stride) {
    if (view_->sigma_m[static_cast<std::size_t>(i)] <= 0) continue;
    directions_.push_back(i);
    normals_.push_back(unit(2.0 * M_PI * i / k));
  }
  root_weight_.assign(directions_.size(), 1.0);
  set_num_residuals(static_cast<int>(directions_.size()));
  *mutable_parameter_block_sizes() = {3, object_dimension, kCameraErrors, 1};
}

bool PrismFactor::predict(const Placement& at, std::size_t row, Prediction& out) const {
  return predict(at, directions_[row], turned(at.observer, normals_[row]), out);
}

double PrismFactor::reweight(double const* const* parameters) {
  double squares = 0.0, misfit = 0.0;
  int count = 0;
  const Eigen::Map<const CameraError> error(parameters[2]);
  const double camera_height_m = view_->cameraHeight(error);
  const Placement at = place(parameters);
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    const auto i = static_cast<std::size_t>(directions_[d]);
    Prediction p;
    root_weight_[d] = 0.0;
    if (!predict(at, d, p)) continue;
    const double inverse = inverseScale(p.height_m, camera_height_m);
    if (p.g >= 0 && !p.height_is_third && inverse <= kLeastInverseScale) continue;  // top over the horizon
    const double r = view_->seenWithout(i, error) - silhouetteFromFootprint(p.g, inverse);
    root_weight_[d] = 1.0 / std::sqrt(1.0 + std::pow(r / (kCauchy * view_->sigma_m[i]), 2));
    squares += std::pow(r * (p.g < 0 ? 1.0 : inverse), 2);
    misfit += std::pow(root_weight_[d] * r / view_->sigma_m[i], 2);
    ++count;
  }
  misfit_ = misfit / std::max(1, count);
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

void PrismFactor::discount() {
  const double u = misfit_ * view_->sigma_factor * view_->sigma_factor;
  for (double& root : root_weight_) root /= std::sqrt(1.0 + u / kHalf);
}

bool PrismFactor::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const CameraError> error(parameters[2]);
  const double camera_height_m = view_->cameraHeight(error);
  // The floor against the calibration's; a laser has none, its metre is a metre.
  const double shrunk = view_->isCameras() ? 1.0 - error(1) : 1.0;
  const Placement at = place(parameters);
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    const auto i = static_cast<std::size_t>(directions_[d]);
    Prediction p;
    const bool known = root_weight_[d] > 0 && predict(at, d, p);
    const double weight = known ? root_weight_[d] / (shrunk * view_->sigma_m[i]) : 0.0;
    residuals[d] = weight * (view_->seenWithout(i, error) -
                             silhouetteFromFootprint(p.g, inverseScale(p.height_m, camera_height_m)));
    if (jacobians == nullptr) continue;
    differentiate(d, p, weight, camera_height_m, jacobians);
    if (jacobians[2] != nullptr && view_->isCameras())
      jacobians[2][kCameraErrors * d + 1] += residuals[d] / shrunk;
  }
  return true;
}

void PrismFactor::differentiate(std::size_t row, const Prediction& p, double weight, double camera_height_m,
                                double** jacobians) const {
  const double inverse = inverseScale(p.height_m, camera_height_m), scale = p.g < 0 ? 1.0 : 1.0 / inverse;
  const auto objects = static_cast<std::size_t>(parameter_block_sizes()[1]);
  for (std::size_t c = 0; c < 3 && jacobians[0] != nullptr; ++c)
    jacobians[0][3 * row + c] = -weight * scale * p.by_first[c];
  for (std::size_t c = 0; c < objects && jacobians[1] != nullptr; ++c)
    jacobians[1][objects * row + c] = -weight * scale * p.by_second[c];
  // The far side is g/(1 − h/H): its derivative by (1 − h/H) times that of this by h and by H.
  const bool shadow = p.g >= 0 && inverse > kLeastInverseScale && camera_height_m > 0;
  const double by_inverse = shadow ? weight * p.g * scale * scale : 0.0;
  if (jacobians[1] != nullptr && p.height_is_third)
    jacobians[1][objects * row + 2] -= shadow ? by_inverse / camera_height_m : 0.0;
  if (jacobians[3] != nullptr) {
    jacobians[3][row] = -weight * scale * p.by_size;
    if (shadow) jacobians[3][row] -= by_inverse / camera_height_m * p.height_by_size;
  }
  if (jacobians[2] == nullptr) return;
  const CameraError& by_error = view_->by_error[static_cast<std::size_t>(directions_[row])];
  constexpr std::size_t kErrors = kCameraErrors;
  for (std::size_t c = 0; c < kErrors; ++c)
    jacobians[2][kErrors * row + c] = -weight * by_error(static_cast<Eigen::Index>(c));
  if (!shadow) return;
  jacobians[2][kErrors * row + 1] -=
      by_inverse * p.height_m / (camera_height_m * camera_height_m) * view_->seen_camera_height_m;
}

LandmarkViewFactor::LandmarkViewFactor(std::shared_ptr<const View> view, std::shared_ptr<const Shape> shape,
                                       int directions)
    : PrismFactor(std::move(view), directions, 4), shape_(std::move(shape)) {}

PrismFactor::Placement LandmarkViewFactor::place(double const* const* parameters) const {
  const double *pose = parameters[0], *mark = parameters[1];
  Placement at;
  at.observer = unit(pose[2]);
  at.foot_m = turned(at.observer, view_->foot_m);
  at.to_m = Eigen::Vector2d(mark[0] - pose[0], mark[1] - pose[1]) - at.foot_m;
  at.corners = {pose[2] - mark[3], static_cast<int>(view_->b_m.size()), Shape::kDirections};
  at.size = parameters[3][0];
  at.height_m = mark[2];
  return at;
}

bool LandmarkViewFactor::predict(const Placement& at, int direction, const Eigen::Vector2d& n,
                                 Prediction& out) const {
  const Corner c = at.corners.at(direction);
  if (!shape_->known(c.i) || !shape_->known(c.j)) return false;
  const double size = at.size / shape_->size();
  const double at_i = size * shape_->a(c.i) - at.height_m * shape_->q(c.i);
  const double at_j = size * shape_->a(c.j) - at.height_m * shape_->q(c.j);
  const Eigen::Vector2d normal = normalTo(n);
  out.g = c.wi * at_i + c.wj * at_j + n.dot(at.to_m);
  out.by_first[0] = -n.x();
  out.by_first[1] = -n.y();
  out.by_first[2] = c.di * at_i + c.dj * at_j + normal.dot(at.to_m) - n.dot(normalTo(at.foot_m));
  out.by_second[0] = n.x();
  out.by_second[1] = n.y();
  out.by_second[2] = -(c.wi * shape_->q(c.i) + c.wj * shape_->q(c.j));
  out.by_second[3] = -(c.di * at_i + c.dj * at_j);
  out.by_size = (c.wi * shape_->a(c.i) + c.wj * shape_->a(c.j)) / shape_->size();
  out.height_m = at.height_m;
  out.height_is_third = true;
  return true;
}

PeerViewFactor::PeerViewFactor(std::shared_ptr<const View> view, std::shared_ptr<const Body> body,
                               const Pose2& offset, int directions)
    : PrismFactor(std::move(view), directions, 3), body_(std::move(body)), offset_(offset) {}

PrismFactor::Placement PeerViewFactor::place(double const* const* parameters) const {
  const double *pose = parameters[0], *peer = parameters[1];
  Placement at;
  at.observer = unit(pose[2]);
  at.foot_m = turned(at.observer, view_->foot_m);
  at.shift_m = turned(unit(peer[2]), offset_.translation());
  at.to_m = Eigen::Vector2d(peer[0] - pose[0], peer[1] - pose[1]) + at.shift_m - at.foot_m;
  at.object = unit(peer[2] + offset_.theta_rad);
  at.size = parameters[3][0];
  at.height_m = at.size * body_->height();
  return at;
}

bool PeerViewFactor::predict(const Placement& at, int /*direction*/, const Eigen::Vector2d& n,
                             Prediction& out) const {
  double slope = 0.0;
  out.by_size = body_->support(turned({at.object.x(), -at.object.y()}, n), &slope);
  slope *= at.size;
  out.g = at.size * out.by_size + n.dot(at.to_m);
  out.by_first[0] = -n.x();
  out.by_first[1] = -n.y();
  out.by_first[2] = slope + normalTo(n).dot(at.to_m) - n.dot(normalTo(at.foot_m));
  out.by_second[0] = n.x();
  out.by_second[1] = n.y();
  out.by_second[2] = -slope + n.dot(normalTo(at.shift_m));
  out.height_m = at.height_m;
  out.height_by_size = body_->height();
  return true;
}

}  // namespace omnifleet::estimation
