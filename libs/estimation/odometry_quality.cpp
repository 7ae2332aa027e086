#include "estimation/odometry_quality.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {

OdometryQualityOptions OdometryQualityOptions::read(const options::Section& section) {
  using options::kPositive;
  OdometryQualityOptions o;
  section.read("memory_steps", o.memory_steps, {2.0, 1e6});
  section.read("prior_steps", o.prior_steps, kPositive);
  section.read("most_m", o.most_m, kPositive);
  section.read("most_rad", o.most_rad, kPositive);
  section.read("sharp_m", o.sharp_m, kPositive);
  section.read("sharp_rad", o.sharp_rad, kPositive);
  section.finish();
  return o;
}

Eigen::Matrix3d OdometryQuality::jitter() const {
  const double m2 = jitter_m_ * jitter_m_;
  return Eigen::Vector3d(m2, m2, jitter_rad_ * jitter_rad_).asDiagonal();
}

Eigen::Matrix3d OdometryQuality::scaled(const Eigen::Matrix3d& claimed) const {
  const Eigen::Vector3d scale(way_scale_, way_scale_, turn_scale_);
  return scale.asDiagonal() * claimed * scale.asDiagonal();
}

void OdometryQuality::interrupt() {
  way_.last.reset();
  turn_.last.reset();
}

void OdometryQuality::add(const Pose2& correction, const Eigen::Matrix3d& of_match,
                          const Eigen::Matrix3d& claimed, double step_m) {
  const Eigen::Vector2d off_m = correction.translation();
  if (!(off_m.norm() < options_.most_m) || !(std::abs(correction.theta_rad) < options_.most_rad)) {
    interrupt();
    return;
  }
  const double match_m2 = of_match.topLeftCorner<2, 2>().trace(), match_rad2 = of_match(2, 2);
  if (match_rad2 < options_.sharp_rad * options_.sharp_rad)
    add(turn_, {correction.theta_rad, 0.0}, claimed(2, 2), match_rad2);
  else
    turn_.last.reset();
  // The jitter of the frame before has turned the step.
  const double swing_m = jitter_rad_ * step_m;
  if (match_m2 < options_.sharp_m * options_.sharp_m)
    add(way_, off_m / std::sqrt(2.0), 0.5 * claimed.topLeftCorner<2, 2>().trace(),
        0.5 * (match_m2 + swing_m * swing_m));
  else
    way_.last.reset();
  jitter_m_ = std::sqrt(jitterVariance(way_));
  jitter_rad_ = std::sqrt(jitterVariance(turn_));
  way_scale_ = scale(way_);
  turn_scale_ = scale(turn_);
}

void OdometryQuality::add(Moments& m, const Eigen::Vector2d& correction, double wheels, double match) const {
  const double keep = 1.0 - 1.0 / options_.memory_steps;
  m.square = keep * m.square + correction.squaredNorm();
  m.wheels = keep * m.wheels + wheels;
  m.matches = keep * m.matches + match;
  m.steps = keep * m.steps + 1.0;
  if (m.last) {
    m.product = keep * m.product + correction.dot(*m.last);
    m.pairs = keep * m.pairs + 1.0;
  }
  m.last = correction;
}

/// Up to the standard error of their product the corrections count as jitter. The rest is certainly an error
/// of the path.
double OdometryQuality::jitterVariance(const Moments& m) const {
  if (!(m.steps > 0)) return 0.0;
  const double square = m.square / m.steps, match = m.matches / m.steps,
               share = m.steps / (m.steps + options_.prior_steps);
  const double product = m.pairs > 0 ? m.product / m.pairs : 0.0,
               error = m.pairs > 0 ? square / std::sqrt(m.pairs) : square;
  return share * std::min(std::max(0.0, -product - match) + error, 0.5 * std::max(0.0, square - match));
}

double OdometryQuality::scale(const Moments& m) const {
  if (!(m.wheels > 0)) return 1.0;
  const double way = m.square - m.matches - 2.0 * jitterVariance(m) * m.steps,
               prior = m.wheels * options_.prior_steps / m.steps;
  return std::sqrt(std::max(1.0, (way + prior) / (m.wheels + prior)));
}

}  // namespace omnifleet::estimation
