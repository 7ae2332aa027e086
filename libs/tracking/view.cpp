#include "tracking/view.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr double kClearlyNear_m =
    -0.01;  // m, a support this far below zero belongs to the contact side at any noise level
constexpr int kFewest = 12;  // of 96: an arc of 45°, enough to determine both axes

/// Normal equations of n·Δ = difference, weighted.
struct ShiftSystem {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double squares = 0.0, weight = 0.0;
  int count = 0;

  void add(const Eigen::Vector2d& n, double difference, double sigma) {
    const double w = 1.0 / (sigma * sigma);
    information += w * n * n.transpose();
    right += w * difference * n;
    squares += w * difference * difference;
    weight += w;
    ++count;
  }
};

}  // namespace

Displacement contactDisplacement(const View& then, const View& now, const Pose2& drift) {
  const Eigen::Vector2d foot_then_m = drift * then.foot_m;
  const double heading_then_rad = drift.theta_rad + then.heading_rad;
  ShiftSystem system;
  for (std::size_t k = 0; k < now.size(); ++k) {
    if (!now.usable(k) || now.supports.b_m[k] > kClearlyNear_m) continue;
    const double phi = now.angle(k);
    const SupportFunction::Value before = then.supports.at(phi - heading_then_rad);
    if (!std::isfinite(before.b_m) || before.b_m > kClearlyNear_m) continue;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const double difference = (now.supports.b_m[k] + n.dot(now.foot_m)) - (before.b_m + n.dot(foot_then_m));
    system.add(n, difference, std::hypot(now.supports.sigma_m[k], before.sigma_m));
  }
  Displacement result;
  if (system.count < kFewest) return result;
  const double a = system.information(0, 0), b = system.information(0, 1), d = system.information(1, 1);
  const double smallest = 0.5 * (a + d) - std::hypot(0.5 * (a - d), b);
  if (smallest <= 1e-9 * (a + d)) return result;
  result.moved_m = system.information.inverse() * system.right;
  const double left = system.squares - result.moved_m.dot(system.right);
  result.rms_m = std::sqrt(std::max(0.0, left) / system.weight);
  constexpr double kCorrelation = 4.0;  // neighbouring directions share supporting points
  result.sigma_m = std::sqrt(kCorrelation / smallest);
  result.valid = true;
  return result;
}

}  // namespace omnifleet::tracking
