// The part of Formation that locates the followed robot: in the own camera or by its published pose.

#include <algorithm>
#include <cmath>

#include "formation/formation.h"

namespace omnifleet::formation {
namespace {

constexpr double kHeadingMps = 0.08;     // m/s, above it the velocity of a track gives its heading
constexpr double kHeadingSeconds = 0.6;  // s, time constant for observed headings and speeds

}  // namespace

const Track* Formation::sighted(const Objects& objects, const Eigen::Vector2d& expected_m) const {
  for (const Sighting& sighting : fleet_.ownSightings()) {
    if (sighting.robot != followed_name_) continue;
    for (const Track& track : objects.tracks) {
      const bool near = (track.position_m - expected_m).norm() < 2.0 * options_.gate_m;
      if (track.id == sighting.track_id && track.visible && near) return &track;
    }
  }
  const Track* best = nullptr;
  double least_m = options_.gate_m;
  for (const Track& track : objects.tracks) {
    const double off_m = (track.position_m - expected_m).norm();
    if (track.kind != ObjectKind::kRobot || !track.visible || off_m >= least_m) continue;
    best = &track;
    least_m = off_m;
  }
  return best;
}

std::optional<motion::Followed> Formation::byPublishedPose(TimeNs now_ns) const {
  const auto own = fleet_.now(robot_, now_ns), other = fleet_.now(followed_name_, now_ns);
  if (!own || !other) return std::nullopt;
  const Pose2 base_from_followed = own->inverse() * *other;
  motion::Followed result{base_from_followed.translation(), base_from_followed.theta_rad,
                          fleet_.twist(followed_name_), false};
  const auto leader = fleet_.now(leader_failover_.leader(), now_ns);
  if (followed_name_ == leader_failover_.leader() || !leader) return result;
  // The formation heads where its leader does: a robot in between may turn for an obstacle of its own.
  result.heading_rad = wrapAngle(leader->theta_rad - own->theta_rad);
  result.twist.forward_mps *= std::cos(leader->theta_rad - other->theta_rad);
  result.twist.turn_radps = fleet_.twist(leader_failover_.leader()).turn_radps;
  return result;
}

/// Without published poses: the heading is that of the motion; for a standing robot, the last known heading.
motion::Followed Formation::byItsMotion(const Track& track) const {
  motion::Followed result;
  const double speed_mps = track.velocity_mps.norm();
  const double seen_rad = std::atan2(track.velocity_mps.y(), track.velocity_mps.x());
  result.position_m = track.position_m;
  result.twist.forward_mps = speed_mps;
  result.heading_rad = seen_rad;
  if (!last_followed_) {
    if (speed_mps <= kHeadingMps) result.heading_rad = 0.0;
    return result;
  }
  // α–β filter: the previous heading has already been propagated by the previous turn rate.
  const double alpha = std::min(1.0, dt_s_ / kHeadingSeconds), beta = 0.5 * alpha * alpha;
  const double off_rad = speed_mps > kHeadingMps ? wrapAngle(seen_rad - last_followed_->heading_rad) : 0.0;
  result.heading_rad = wrapAngle(last_followed_->heading_rad + alpha * off_rad);
  const double turned_radps = dt_s_ > 0.0 ? beta * off_rad / dt_s_ : 0.0;
  result.twist.turn_radps = speed_mps > kHeadingMps ? last_followed_->twist.turn_radps + turned_radps : 0.0;
  return result;
}

std::optional<motion::Followed> Formation::followed(const Objects& objects, const motion::Slot& slot) {
  const std::string& name = leader_failover_.ranks()[slot.followed];
  if (name != followed_name_) switchFollowed(name);
  std::optional<motion::Followed> result = byPublishedPose(objects.acquired_ns);
  Eigen::Vector2d expected_m =
      slot.distance_m * Eigen::Vector2d(std::cos(slot.angle_rad), std::sin(slot.angle_rad));
  if (result) {
    expected_m = result->position_m;
  } else if (last_followed_) {
    expected_m = last_followed_->position_m;
  }
  if (const Track* track = sighted(objects, expected_m)) {
    if (!result) result = byItsMotion(*track);
    result->position_m = track->position_m;
    result->seen = true;
  }
  if (result) {
    last_followed_ = result;
    last_followed_ns_ = objects.acquired_ns;
    trail_.add(result->position_m);
  } else if (last_followed_ && seconds(last_followed_ns_, objects.acquired_ns) <= options_.unseen_limit_s) {
    result = last_followed_;
    result->seen = false;
  }
  return result;
}

/// Switches to another followed robot.
void Formation::switchFollowed(const std::string& followed_name) {
  followed_name_ = followed_name;
  last_followed_.reset();
  trail_.clear();
}

}  // namespace omnifleet::formation
