#include "formation/fleet_view.h"

namespace omnifleet::formation {
namespace {
constexpr double kSecondsPerNs = 1e-9;
constexpr double kSpeedSmoothing = 0.5;  // weight of the latest published step in the speed
}  // namespace

double seconds(TimeNs from_ns, TimeNs to_ns) {
  return static_cast<double>(to_ns - from_ns) * kSecondsPerNs;
}

Pose2 advanced(const Pose2& pose, const motion::Twist& twist, double dt_s) {
  return pose * motion::rolled(twist.forward_mps * dt_s - 0.5 * twist.turn_radps * dt_s,
                               twist.forward_mps * dt_s + 0.5 * twist.turn_radps * dt_s, 1.0,
                               motion::Integration::kArc);
}

void FleetView::moved(TimeNs from_ns, TimeNs to_ns, const Pose2& from_from_to) {
  moved_.push_back({from_ns, to_ns, from_from_to});
  while (seconds(moved_.front().to_ns, to_ns) > pose_age_limit_s_) moved_.pop_front();
}

void FleetView::learn(const std::vector<PoseEstimate>& poses) {
  for (const PoseEstimate& pose : poses) {
    if (!pose.valid || !pose.frame.empty() || !pose.map_from_base.isFinite()) continue;
    if (!others_ && pose.robot != robot_) continue;
    const auto [entry, is_new] = known_.try_emplace(pose.robot);
    Known& known = entry->second;
    const double dt_s = seconds(known.acquired_ns, pose.acquired_ns);
    if (!is_new && dt_s <= 0.0) continue;
    if (!is_new && dt_s < pose_age_limit_s_) {
      const Pose2 step = known.map_from_base.inverse() * pose.map_from_base;
      known.twist.forward_mps += kSpeedSmoothing * (step.x_m / dt_s - known.twist.forward_mps);
      known.twist.turn_radps += kSpeedSmoothing * (step.theta_rad / dt_s - known.twist.turn_radps);
    } else {
      known.twist = {};
    }
    known.map_from_base = pose.map_from_base;
    known.acquired_ns = pose.acquired_ns;
    if (others_) known.sightings = pose.sightings;
  }
}

std::optional<Pose2> FleetView::now(const std::string& robot, TimeNs now_ns) const {
  const auto found = known_.find(robot);
  if (found == known_.end()) return std::nullopt;
  const Known& known = found->second;
  const double age_s = seconds(known.acquired_ns, now_ns);
  if (age_s < 0.0 || age_s > pose_age_limit_s_) return std::nullopt;
  if (robot != robot_) return advanced(known.map_from_base, known.twist, age_s);
  Pose2 map_from_base = known.map_from_base;
  for (const Moved& moved : moved_) {
    if (moved.from_ns >= known.acquired_ns) map_from_base = map_from_base * moved.from_from_to;
  }
  return map_from_base;
}

motion::Twist FleetView::twist(const std::string& robot) const {
  const auto found = known_.find(robot);
  return found == known_.end() ? motion::Twist{} : found->second.twist;
}

const std::vector<Sighting>& FleetView::ownSightings() const {
  static const std::vector<Sighting> kNone;
  const auto own = known_.find(robot_);
  return own == known_.end() ? kNone : own->second.sightings;
}

}  // namespace omnifleet::formation
