#include "estimation/prism_factors.h"

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace omnifleet::estimation {
namespace {
constexpr double kCauchy = 2.0;  // in σ: residual at which a direction counts half
}

PrismFactor::PrismFactor(std::shared_ptr<const View> view, int directions, int object_dimension)
    : view_(std::move(view)) {
  const int k = static_cast<int>(view_->b_m.size());
  const int stride = std::max(1, k / std::max(1, directions));
  for (int i = 0; i < k; i += stride) {
    if (view_->sigma_m[static_cast<std::size_t>(i)] > 0) directions_.push_back(i);
  }
  root_weight_.assign(directions_.size(), 1.0);
  set_num_residuals(static_cast<int>(directions_.size()));
  *mutable_parameter_block_sizes() = {3, object_dimension, kCameraErrors, 1};
}

double PrismFactor::reweight(double const* const* parameters) {
  double squares = 0.0;
  int count = 0;
  const Eigen::Map<const CameraError> error(parameters[2]);
  const double camera_height_m = view_->cameraHeight(error);
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    const auto i = static_cast<std::size_t>(directions_[d]);
    Prediction p;
    root_weight_[d] = 0.0;
    if (!predict(parameters, 2.0 * M_PI * directions_[d] / static_cast<double>(view_->b_m.size()), p))
      continue;
    const double inverse = inverseScale(p.height_m, camera_height_m);
    if (p.g >= 0 && !p.height_is_third && inverse <= kLeastInverseScale) continue;  // top over the horizon
    const double r = view_->seenWithout(i, error) - silhouetteFromFootprint(p.g, inverse);
    root_weight_[d] = 1.0 / std::sqrt(1.0 + std::pow(r / (kCauchy * view_->sigma_m[i]), 2));
    squares += std::pow(r * (p.g < 0 ? 1.0 : inverse), 2);
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

bool PrismFactor::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const CameraError> error(parameters[2]);
  const double camera_height_m = view_->cameraHeight(error);
  const double shrunk = 1.0 - error(1);  // the floor against the calibration's
  for (std::size_t d = 0; d < directions_.size(); ++d) {
    const auto i = static_cast<std::size_t>(directions_[d]);
    Prediction p;
    const bool known =
        root_weight_[d] > 0 &&
        predict(parameters, 2.0 * M_PI * directions_[d] / static_cast<double>(view_->b_m.size()), p);
    const double weight = known ? root_weight_[d] / (shrunk * view_->sigma_m[i]) : 0.0;
    residuals[d] = weight * (view_->seenWithout(i, error) -
                             silhouetteFromFootprint(p.g, inverseScale(p.height_m, camera_height_m)));
    if (jacobians == nullptr) continue;
    differentiate(d, p, weight, camera_height_m, jacobians);
    if (jacobians[2] != nullptr) jacobians[2][kCameraErrors * d + 1] += residuals[d] / shrunk;
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

bool LandmarkViewFactor::predict(double const* const* parameters, double phi_rad, Prediction& out) const {
  const double* pose = parameters[0];
  const double* mark = parameters[1];
  const double psi = phi_rad + pose[2], height = mark[2];
  const Corner c = cornerAt(psi - mark[3], Shape::kDirections);
  if (!shape_->known(c.i) || !shape_->known(c.j)) return false;
  const Eigen::Vector2d n(std::cos(psi), std::sin(psi)), normal(-n.y(), n.x());
  const double cosine = std::cos(pose[2]), sine = std::sin(pose[2]);
  const Eigen::Vector2d foot(cosine * view_->foot_m.x() - sine * view_->foot_m.y(),
                             sine * view_->foot_m.x() + cosine * view_->foot_m.y());
  const Eigen::Vector2d to(mark[0] - pose[0] - foot.x(), mark[1] - pose[1] - foot.y());
  const double size = parameters[3][0] / shape_->size();
  const double at_i = size * shape_->a(c.i) - height * shape_->q(c.i);
  const double at_j = size * shape_->a(c.j) - height * shape_->q(c.j);
  out.g = c.wi * at_i + c.wj * at_j + n.dot(to);
  out.by_first[0] = -n.x();
  out.by_first[1] = -n.y();
  out.by_first[2] = c.di * at_i + c.dj * at_j + normal.dot(to) - n.dot(Eigen::Vector2d(-foot.y(), foot.x()));
  out.by_second[0] = n.x();
  out.by_second[1] = n.y();
  out.by_second[2] = -(c.wi * shape_->q(c.i) + c.wj * shape_->q(c.j));
  out.by_second[3] = -(c.di * at_i + c.dj * at_j);
  out.by_size = (c.wi * shape_->a(c.i) + c.wj * shape_->a(c.j)) / shape_->size();
  out.height_m = height;
  out.height_is_third = true;
  return true;
}

PeerViewFactor::PeerViewFactor(std::shared_ptr<const View> view, std::shared_ptr<const Body> body,
                               const Pose2& offset, int directions)
    : PrismFactor(std::move(view), directions, 3), body_(std::move(body)), offset_(offset) {}

bool PeerViewFactor::predict(double const* const* parameters, double phi_rad, Prediction& out) const {
  const double* pose = parameters[0];
  const double* peer = parameters[1];
  const double psi = phi_rad + pose[2];
  const Eigen::Vector2d n(std::cos(psi), std::sin(psi)), normal(-n.y(), n.x());
  const auto rotated = [](double angle, const Eigen::Vector2d& v) {
    return Eigen::Vector2d(std::cos(angle) * v.x() - std::sin(angle) * v.y(),
                           std::sin(angle) * v.x() + std::cos(angle) * v.y());
  };
  const Eigen::Vector2d foot = rotated(pose[2], view_->foot_m);
  const Eigen::Vector2d shift = rotated(peer[2], offset_.translation());
  const Eigen::Vector2d to(peer[0] + shift.x() - pose[0] - foot.x(),
                           peer[1] + shift.y() - pose[1] - foot.y());
  double slope = 0.0;
  const double size = parameters[3][0];
  out.by_size = body_->support(psi - peer[2] - offset_.theta_rad, &slope);
  slope *= size;
  out.g = size * out.by_size + n.dot(to);
  out.by_first[0] = -n.x();
  out.by_first[1] = -n.y();
  out.by_first[2] = slope + normal.dot(to) - n.dot(Eigen::Vector2d(-foot.y(), foot.x()));
  out.by_second[0] = n.x();
  out.by_second[1] = n.y();
  out.by_second[2] = -slope + n.dot(Eigen::Vector2d(-shift.y(), shift.x()));
  out.height_m = size * body_->height();
  out.height_by_size = body_->height();
  return true;
}

}  // namespace omnifleet::estimation
