#include "estimation/wheel_log.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSecondsPerNs = 1e-9;
constexpr double kDriving_mps = 0.02, kTurning_radps = 0.05;  // above this the walks are whole

/// Takes a right perturbation from the source frame of `step` to its end frame.
Eigen::Matrix3d carried(const Pose2& step) {
  const Pose2 back = step.inverse();
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = back.rotation();
  adjoint.topRightCorner<2, 1>() = Eigen::Vector2d(back.y_m, -back.x_m);
  return adjoint;
}

TimeNs delayed(TimeNs time_ns, double delay_s) {
  return time_ns - static_cast<TimeNs>(std::llround(delay_s / kSecondsPerNs));
}

}  // namespace

WheelLogOptions WheelLogOptions::read(const options::Section& section) {
  WheelLogOptions o;
  section.read("scale_sigma", o.scale_sigma, {1e-6, 0.5});
  section.read("turn_sigma", o.turn_sigma, {1e-6, 0.5});
  section.read("delay_sigma_s", o.delay_sigma_s, {1e-6, 2.0});
  section.read("crab_sigma_rad", o.crab_sigma_rad, {1e-6, 0.5});
  section.read("way_walk", o.way_walk, {1e-6, 10.0});
  section.read("way_walk_turning", o.way_walk_turning, {0.0, 10.0});
  section.read("side_walk", o.side_walk, {1e-6, 10.0});
  section.read("turn_walk", o.turn_walk, {1e-6, 10.0});
  section.read("turn_walk_turning", o.turn_walk_turning, {0.0, 10.0});
  section.read("hold_limit_s", o.hold_limit_s, options::kPositive);
  section.finish();
  return o;
}

bool WheelLog::add(TimeNs time_ns, double left_mps, double right_mps) {
  if (!std::isfinite(left_mps) || !std::isfinite(right_mps)) return false;
  if (!rows_.empty() && time_ns <= rows_.back().time_ns) return false;
  rows_.push_back({time_ns, left_mps, right_mps});
  return true;
}

void WheelLog::forgetBefore(TimeNs time_ns) {
  while (rows_.size() > 1 && rows_[1].time_ns <= time_ns) rows_.pop_front();
}

std::size_t WheelLog::rowAt(TimeNs time_ns) const {
  const auto after = std::upper_bound(rows_.begin(), rows_.end(), time_ns,
                                      [](TimeNs t, const Row& row) { return t < row.time_ns; });
  return after == rows_.begin() ? 0 : static_cast<std::size_t>(after - rows_.begin()) - 1;
}

bool WheelLog::covers(TimeNs from_ns, TimeNs to_ns) const {
  if (rows_.empty() || rows_.front().time_ns > from_ns) return false;
  const auto limit_ns = static_cast<TimeNs>(options_.hold_limit_s / kSecondsPerNs);
  for (std::size_t i = rowAt(from_ns); i < rows_.size() && rows_[i].time_ns < to_ns; ++i) {
    const TimeNs until_ns = i + 1 < rows_.size() ? std::min(rows_[i + 1].time_ns, to_ns) : to_ns;
    if (until_ns - rows_[i].time_ns > limit_ns) return false;
  }
  return true;
}

Pose2 WheelLog::integrate(TimeNs from_ns, TimeNs to_ns, double separation_m, const WheelModel& model,
                          Eigen::Matrix3d* covariance) const {
  const TimeNs begin_ns = delayed(from_ns, model(kDelay)), end_ns = delayed(to_ns, model(kDelay));
  Pose2 previous_from_current;
  for (std::size_t i = rowAt(begin_ns); i < rows_.size() && (i == 0 || rows_[i].time_ns < end_ns); ++i) {
    // What lies before the first row moves as the first row says: a delay about to be learned looks there.
    const TimeNs since_ns = i == 0 ? begin_ns : std::max(begin_ns, rows_[i].time_ns);
    const TimeNs until_ns = i + 1 < rows_.size() ? std::min(rows_[i + 1].time_ns, end_ns) : end_ns;
    const double dt_s = static_cast<double>(until_ns - since_ns) * kSecondsPerNs;
    if (dt_s <= 0) continue;
    const double left_m = rows_[i].left_mps * (1.0 + model(0)) * dt_s;
    const double right_m = rows_[i].right_mps * (1.0 + model(1)) * dt_s;
    const Pose2 straight = arc(left_m, right_m, separation_m / (1.0 + model(2)));
    const Eigen::Vector2d way_m = Eigen::Rotation2Dd(model(4)) * straight.translation();
    const Pose2 step{way_m.x(), way_m.y(), straight.theta_rad};
    previous_from_current = previous_from_current * step;
    if (covariance == nullptr) continue;
    const double speed_mps = 0.5 * std::abs(left_m + right_m) / dt_s;
    const double rate_radps = std::abs(right_m - left_m) / separation_m / dt_s;
    const double driven = std::min(1.0, speed_mps / kDriving_mps + rate_radps / kTurning_radps);
    const double way = options_.way_walk * driven + options_.way_walk_turning * rate_radps;
    const double turn = options_.turn_walk * driven + options_.turn_walk_turning * rate_radps;
    const Eigen::Matrix3d carry = carried(step);
    *covariance = carry * *covariance * carry.transpose();
    const double side = options_.side_walk * driven;
    covariance->diagonal() += dt_s * Eigen::Vector3d(way * way, side * side, turn * turn);
  }
  return previous_from_current;
}

bool WheelLog::between(TimeNs from_ns, TimeNs to_ns, double separation_m, const WheelModel& model,
                       double delay_sigma_s, Motion& motion) const {
  constexpr double kLeastStep_s = 0.02;
  if (!(separation_m > 0) || to_ns <= from_ns || !covers(from_ns, to_ns)) return false;
  motion.covariance.setZero();
  motion.previous_from_current = integrate(from_ns, to_ns, separation_m, model, &motion.covariance);
  const Pose2 back = motion.previous_from_current.inverse();
  const auto increment = [&](const WheelModel& other) {
    return (back * integrate(from_ns, to_ns, separation_m, other, nullptr)).vector();
  };
  const double apart_s = std::sqrt(3.0) * delay_sigma_s;
  const WheelModel step(1e-4, 1e-4, 1e-4, std::max(kLeastStep_s, apart_s), 1e-4);
  for (int i = 0; i < 5; ++i) {
    WheelModel more = model, less = model;
    more(i) += step(i);
    less(i) -= step(i);
    const Eigen::Vector3d up = increment(more), down = increment(less);
    motion.jacobian.col(i) = (up - down) / (2.0 * step(i));
    if (i != kDelay) continue;
    // Of a line it is zero; its mean is a sixth, its variance 1/18. Speeds change in steps: what they bend
    // grows with the points' distance.
    const Eigen::Vector3d bend = (up + down) * std::min(1.0, apart_s / kLeastStep_s);
    motion.covariance += bend * bend.transpose() / 18.0;
    const Eigen::Vector3d mean = bend / 6.0;
    motion.previous_from_current = motion.previous_from_current * Pose2::fromVector(mean);
  }
  return true;
}

}  // namespace omnifleet::estimation
