#include "tracking/own_motion.h"

#include <algorithm>

#include "geometry/twist.h"

namespace omnifleet::tracking {
namespace {
constexpr TimeNs kKept_ns = 10'000'000'000;
constexpr TimeNs kSame_ns = 1'000;  // stamps of the same frame are copies; this tolerates rounding
}  // namespace

bool OwnMotion::advance(const Motion& motion, TimeNs acquired_ns) {
  const bool first = path_.empty();
  step_s_ = first ? 0.0 : std::max<double>(0.0, static_cast<double>(acquired_ns - now_ns_) * 1e-9);
  now_ns_ = acquired_ns;
  step_m_ = 0.0;
  step_covariance_.setZero();
  const auto since = std::find_if(path_.rbegin(), path_.rend(), [&](const Entry& e) {
    return std::abs(e.time_ns - motion.since_ns) <= kSame_ns;
  });
  const bool known = motion.valid && motion.previous_from_current.isFinite() && since != path_.rend() &&
                     acquired_ns > since->time_ns;
  if (known) {
    odom_from_base_ = since->odom_from_base * motion.previous_from_current;
    step_m_ = motion.previous_from_current.translation().norm();
    step_covariance_ = motion.covariance;
  } else if (!first) {
    path_.clear();
  }
  while (!path_.empty() && path_.back().time_ns >= acquired_ns) path_.pop_back();
  while (!path_.empty() && acquired_ns - path_.front().time_ns > kKept_ns) path_.pop_front();
  path_.push_back({acquired_ns, odom_from_base_});
  return known || first;
}

void OwnMotion::locate(TimeNs time_ns, const Pose2& map_from_base) {
  if (!places_.empty() && time_ns <= places_.back().time_ns) return;
  while (!places_.empty() && time_ns - places_.front().time_ns > kKept_ns) places_.pop_front();
  places_.push_back({time_ns, map_from_base});
}

/// The last localized pose up to that time, extended with odometry.
std::optional<Pose2> OwnMotion::mapFromBaseAt(TimeNs time_ns) const {
  const auto place = std::find_if(places_.rbegin(), places_.rend(),
                                  [&](const Place& p) { return p.time_ns <= time_ns + kSame_ns; });
  if (place == places_.rend()) return {};
  const auto from = odomFromBaseAt(place->time_ns), to = odomFromBaseAt(time_ns);
  if (!from || !to) return {};
  return place->map_from_base * from->inverse() * *to;
}

std::optional<Pose2> OwnMotion::driftSince(TimeNs then_ns) const {
  const auto odom_from_then = odomFromBaseAt(then_ns), map_from_then = mapFromBaseAt(then_ns),
             map_from_now = mapFromBaseAt(now_ns_);
  if (!odom_from_then || !map_from_then || !map_from_now) return {};
  const Pose2 then_from_now = map_from_then->inverse() * *map_from_now;
  return odom_from_base_ * then_from_now.inverse() * odom_from_then->inverse();
}

std::optional<Pose2> OwnMotion::extrapolate(double dt_s) const {
  if (path_.size() < 2) return {};
  const Entry &last = path_.back(), &before = path_[path_.size() - 2];
  const double over_s = static_cast<double>(last.time_ns - before.time_ns) * 1e-9;
  return fractionOf(before.odom_from_base.inverse() * last.odom_from_base, dt_s / over_s);
}

std::optional<Pose2> OwnMotion::odomFromBaseAt(TimeNs time_ns) const {
  if (path_.empty() || time_ns < path_.front().time_ns || time_ns > path_.back().time_ns + kSame_ns)
    return {};
  const auto after = std::lower_bound(path_.begin(), path_.end(), time_ns,
                                      [](const Entry& e, TimeNs t) { return e.time_ns < t; });
  if (after == path_.end()) return path_.back().odom_from_base;
  if (after == path_.begin() || after->time_ns == time_ns) return after->odom_from_base;
  const Entry& before = *(after - 1);
  const double part =
      static_cast<double>(time_ns - before.time_ns) / static_cast<double>(after->time_ns - before.time_ns);
  const Pose2 step = before.odom_from_base.inverse() * after->odom_from_base;
  return before.odom_from_base * Pose2{part * step.x_m, part * step.y_m, part * step.theta_rad};
}

}  // namespace omnifleet::tracking
