#include "motion/wheel_integrator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace omnifleet::motion {
namespace {

constexpr double kSecondsPerNs = 1e-9;

/// Derivative of the pose increment of one arc with respect to the distances of both wheels, in the end frame
/// of the increment.
Eigen::Matrix<double, 3, 2> wheelJacobian(const Pose2& step, double length_m, double separation_m) {
  // End-frame rates. Extra roll of one wheel at the middle of the step moves the end by half of it along the
  // mid heading. It also turns the end by ±1/L about the middle, which shifts it sideways by half the length.
  const double half_rad = 0.5 * step.theta_rad;
  const double c = std::cos(half_rad), s = std::sin(half_rad);
  const Eigen::Vector3d along(c, -s, 0.0);
  const Eigen::Vector3d about(0.5 * length_m * s, 0.5 * length_m * c, 1.0);
  Eigen::Matrix<double, 3, 2> jacobian;
  jacobian.col(0) = 0.5 * along - about / separation_m;
  jacobian.col(1) = 0.5 * along + about / separation_m;
  return jacobian;
}

/// Maps a right perturbation from the source frame of `step` to its end frame (the adjoint of its inverse).
Eigen::Matrix3d adjointToEnd(const Pose2& step) {
  const Pose2 back = step.inverse();
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = back.rotation();
  adjoint.topRightCorner<2, 1>() = Eigen::Vector2d(back.y_m, -back.x_m);
  return adjoint;
}

}  // namespace

WheelIntegrator::Options WheelIntegrator::Options::read(const options::Section& section) {
  Options options;
  section.read("use", options.use);
  std::string integration = "arc";
  section.read("integration", integration, {"arc", "euler"});
  options.integration = integration == "arc" ? Integration::kArc : Integration::kEuler;
  section.read("noise", options.noise, {0.0, 1.0});
  section.read("noise_floor_mps", options.noise_floor_mps, {1e-6, 1.0});
  section.read("scale_sigma", options.scale_sigma, {0.0, 0.5});
  section.read("side_slip", options.side_slip, {0.0, 1.0});
  section.read("overdue_s", options.overdue_s, options::kPositive);
  section.read("overdue_mps2", options.overdue_mps2, options::kNotNegative);
  section.read("hold_limit_s", options.hold_limit_s, options::kPositive);
  section.finish();
  return options;
}

/// Motion and noise accumulated over one interval, in the frame of its current end.
struct WheelIntegrator::Sums {
  Motion motion;
  Eigen::Matrix3d white = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> by_scale = Eigen::Matrix<double, 3, 2>::Zero();
};

WheelIntegrator::WheelIntegrator(double wheel_separation_m, const Options& options)
    : wheel_separation_m_(wheel_separation_m), options_(options) {
  if (!(wheel_separation_m > 0.0)) throw std::runtime_error("wheel_separation_m must be positive");
}

bool WheelIntegrator::add(TimeNs time_ns, double left_mps, double right_mps) {
  if (!std::isfinite(left_mps) || !std::isfinite(right_mps)) return false;
  if (!rows_.empty() && time_ns <= rows_.back().time_ns) return false;
  rows_.push_back({time_ns, {left_mps, right_mps}});
  return true;
}

Motion WheelIntegrator::motionTo(TimeNs time_ns) {
  Sums sums;
  sums.motion.since_ns = has_frame_ ? frame_ns_ : time_ns;
  const bool forward = has_frame_ && time_ns > frame_ns_;
  if (forward && wheel_separation_m_ > 0.0 && covers(frame_ns_, time_ns)) {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const TimeNs until_ns = i + 1 < rows_.size() ? std::min(rows_[i + 1].time_ns, time_ns) : time_ns;
      roll(rows_[i], std::max(rows_[i].time_ns, frame_ns_), until_ns, sums);
    }
    const double scale_variance = options_.scale_sigma * options_.scale_sigma;
    sums.motion.covariance = sums.white + scale_variance * sums.by_scale * sums.by_scale.transpose();
    sums.motion.valid = true;
  }
  if (!has_frame_ || forward) {
    frame_ns_ = time_ns;
    has_frame_ = true;
    forgetBefore(time_ns);
  }
  return sums.motion;
}

bool WheelIntegrator::covers(TimeNs from_ns, TimeNs to_ns) const {
  if (rows_.empty() || rows_.front().time_ns > from_ns) return false;
  const auto limit_ns = static_cast<TimeNs>(options_.hold_limit_s / kSecondsPerNs);
  for (std::size_t i = 0; i < rows_.size() && rows_[i].time_ns < to_ns; ++i) {
    const TimeNs until_ns = i + 1 < rows_.size() ? std::min(rows_[i + 1].time_ns, to_ns) : to_ns;
    if (until_ns > from_ns && until_ns - rows_[i].time_ns > limit_ns) return false;
  }
  return true;
}

void WheelIntegrator::roll(const Row& row, TimeNs from_ns, TimeNs to_ns, Sums& sums) const {
  if (to_ns <= from_ns) return;
  const double dt_s = static_cast<double>(to_ns - from_ns) * kSecondsPerNs;
  const Eigen::Vector2d rolled_m(row.speeds.left_mps * dt_s, row.speeds.right_mps * dt_s);
  const double length_m = 0.5 * rolled_m.sum();
  const Pose2 step = rolled(rolled_m.x(), rolled_m.y(), wheel_separation_m_, options_.integration);
  const Eigen::Matrix<double, 3, 2> jacobian = wheelJacobian(step, length_m, wheel_separation_m_);
  const Eigen::Matrix3d adjoint = adjointToEnd(step);

  const double age_s = static_cast<double>(to_ns - row.time_ns) * kSecondsPerNs;
  const double stale_mps = std::max(0.0, age_s - options_.overdue_s) * options_.overdue_mps2;
  Eigen::Vector2d variance;
  for (int wheel = 0; wheel < 2; ++wheel) {
    const double noise_m = options_.noise * rolled_m(wheel);
    variance(wheel) =
        noise_m * noise_m + std::pow(options_.noise_floor_mps * dt_s, 2) + std::pow(stale_mps * dt_s, 2);
  }
  sums.white =
      adjoint * sums.white * adjoint.transpose() + jacobian * variance.asDiagonal() * jacobian.transpose();
  // Sideways slip with σ = side_slip per metre, independent per metre: its variance grows with the distance.
  sums.white(1, 1) += options_.side_slip * options_.side_slip * std::abs(length_m) + 1e-12;
  sums.by_scale = adjoint * sums.by_scale + jacobian * rolled_m.asDiagonal();
  sums.motion.previous_from_current = sums.motion.previous_from_current * step;
  sums.motion.left_m += rolled_m.x();
  sums.motion.right_m += rolled_m.y();
}

void WheelIntegrator::forgetBefore(TimeNs time_ns) {
  while (rows_.size() > 1 && rows_[1].time_ns <= time_ns) rows_.pop_front();
}

}  // namespace omnifleet::motion
