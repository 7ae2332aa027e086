#include "tracking/body_fit.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr int kTable = 720;             // support table of the outline: 0.5°
constexpr double kHalfWeight_m = 0.02;  // σ at which a direction has half weight
constexpr double kLeastArc = 0.15;      // weighted share of all directions
constexpr double kLeastRatio = 0.05;    // u = 1 − h/H; a body as tall as the camera has no far side

double heightRatio(double height_m, double camera_height_m) {
  return camera_height_m > 0.0 ? 1.0 - height_m / camera_height_m : 1.0;
}

}  // namespace

BodyModel::BodyModel(const RobotBody& body) : round_(body.radius_m > 0.0), height_m_(body.height_m) {
  if (round_) {
    mean_radius_m_ = body.radius_m;
    return;
  }
  const SupportFunction h = SupportFunction::of(body.footprint_m, Eigen::Vector2d::Zero(), 1.0, kTable);
  for (int i = 0; i < kTable; ++i) {
    const double a = 2.0 * M_PI * i / kTable, value = h.b_m[static_cast<std::size_t>(i)];
    mean_radius_m_ += value / kTable;
    offset_m_ += 2.0 / kTable * value * Eigen::Vector2d(std::cos(a), std::sin(a));  // Steiner point
  }
  for (int i = 0; i < kTable; ++i) {
    const double a = 2.0 * M_PI * i / kTable;
    support_m_.push_back(h.b_m[static_cast<std::size_t>(i)] -
                         offset_m_.dot(Eigen::Vector2d(std::cos(a), std::sin(a))));
  }
}

double BodyModel::support(double angle_rad) const {
  if (round_) return mean_radius_m_;
  const double turns = angle_rad / (2.0 * M_PI);
  const auto i = static_cast<int>(std::lround((turns - std::floor(turns)) * kTable)) % kTable;
  return support_m_[static_cast<std::size_t>(i)];
}

double BodyModel::predictedSupport(const View& view, std::size_t k, const Eigen::Vector2d& centre_m,
                                   double heading_rad) const {
  const double phi = view.angle(k);
  const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
  const double g = support(phi - heading_rad) + n.dot(centre_m - view.foot_m);
  return g < 0.0 ? g : g / std::max(kLeastRatio, heightRatio(height_m_, view.camera_height_m));
}

BodyFit BodyModel::fitAt(const View& view, double heading_rad) const {
  const double ratio = heightRatio(height_m_, view.camera_height_m);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double squares = 0.0, weight = 0.0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    const double b = view.supports.b_m[k];
    if (!view.usable(k) || (b >= 0.0 && ratio < kLeastRatio)) continue;
    const double phi = view.angle(k), shrink = b < 0.0 ? 1.0 : ratio;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const double measured = shrink * b + n.dot(view.foot_m) - support(phi - heading_rad);
    const double noise = shrink * view.supports.sigma_m[k] / kHalfWeight_m;
    const double w = 1.0 / (1.0 + noise * noise);
    information += w * n * n.transpose();
    right += w * measured * n;
    squares += w * measured * measured;
    weight += w;
  }
  BodyFit fit;
  fit.heading_rad = heading_rad;
  fit.arc = weight / static_cast<double>(view.size());
  if (fit.arc < kLeastArc || information.determinant() < 1e-3 * weight * weight) return fit;
  fit.centre_m = information.inverse() * right;
  fit.rms_m = std::sqrt(std::max(0.0, squares - fit.centre_m.dot(right)) / weight);
  fit.valid = true;
  return fit;
}

BodyFit BodyModel::fit(const View& view) const {
  if (view.supports.empty()) return {};
  if (round_) return fitAt(view, 0.0);
  BodyFit best;
  for (std::size_t k = 0; k < view.size(); ++k) {
    const BodyFit fit = fitAt(view, wrapAngle(view.angle(k)));
    if (fit.valid && (!best.valid || fit.rms_m < best.rms_m)) best = fit;
  }
  return best;
}

}  // namespace omnifleet::tracking
