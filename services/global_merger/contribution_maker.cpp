#include <algorithm>
#include <cmath>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

KeyframeOptions KeyframeOptions::read(const options::Section& section) {
  KeyframeOptions o;
  o.rays = occupancy::MapRaysOptions::read(section.child("rays"));
  section.read("distance_m", o.distance_m, {0.0, 100.0});
  section.read("rotation_rad", o.rotation_rad, {0.0, 6.3});
  section.read("interval_s", o.interval_s, {0.0, 3600.0});
  section.read("min_interval_s", o.min_interval_s, {0.0, 3600.0});
  section.read("at_rest_share", o.at_rest_share, {0.0, 1.0});
  section.read("at_rest_s", o.at_rest_s, {0.0, 3600.0});
  section.read("odometry_sigma_m", o.odometry_sigma_m, options::kNotNegative);
  section.read("odometry_sigma_rad", o.odometry_sigma_rad, options::kNotNegative);
  section.finish();
  return o;
}

/// Whether an object appeared, vanished, moved or changed its kind since the last keyframe of a robot at
/// rest.
bool ContributionMaker::seesChange(const Objects& objects) const {
  std::size_t visible = 0;
  for (const Track& track : objects.tracks) {
    if (!track.visible) continue;
    ++visible;
    const bool same = std::any_of(last_objects_.begin(), last_objects_.end(), [&](const SeenObject& object) {
      return object.track_id == track.id && object.kind == track.kind &&
             (object.position_m - track.position_m).norm() < options_.distance_m;
    });
    if (!same) return true;
  }
  return visible != last_objects_.size();
}

bool ContributionMaker::isDue(const Objects& objects, const Pose2& map_from_base) {
  constexpr double kSeconds = 1e-9;
  const double passed_s = static_cast<double>(objects.acquired_ns - last_ns_) * kSeconds;
  const Pose2 way = last_map_from_base_.inverse() * map_from_base;
  const bool moved =
      way.translation().norm() >= options_.distance_m || std::abs(way.theta_rad) >= options_.rotation_rad;
  if (moved || seesChange(objects)) changed_ns_ = objects.acquired_ns;
  const double at_rest_s = static_cast<double>(objects.acquired_ns - changed_ns_) * kSeconds;
  const double wait_s =
      std::max(options_.interval_s, std::min(options_.at_rest_s, options_.at_rest_share * at_rest_s));
  return passed_s >= (moved ? options_.min_interval_s : std::max(options_.min_interval_s, wait_s));
}

/// A guess is no fact: while only odometry determines the pose, frames are mapped as long as it is as good as
/// a cell of the map.
static bool isSure(const PoseEstimate& pose, const KeyframeOptions& options) {
  const double sigma_m = options.odometry_sigma_m, sigma_rad = options.odometry_sigma_rad;
  if (pose.state != LocalizationState::kOdometryOnly && pose.state != LocalizationState::kLost) return true;
  return 0.5 * pose.covariance.topLeftCorner<2, 2>().trace() <= sigma_m * sigma_m &&
         pose.covariance(2, 2) <= sigma_rad * sigma_rad;
}

std::optional<ContributionMaker::Made> ContributionMaker::make(const Objects& objects,
                                                               const PoseEstimate& pose) {
  if (objects.state != FrameState::kOk || !pose.valid || !pose.map_from_base.isFinite()) return std::nullopt;
  if (!isSure(pose, options_)) return std::nullopt;
  if (objects.acquired_ns != pose.acquired_ns || objects.robot != pose.robot) return std::nullopt;
  if (any_ && (objects.acquired_ns <= last_ns_ || !isDue(objects, pose.map_from_base))) return std::nullopt;
  Made made{occupancy::makeContribution(objects, rays_.of(objects)), occupancy::makeKeyframePose(pose)};
  if (!made.pose.valid) return std::nullopt;
  if (!any_) changed_ns_ = objects.acquired_ns;
  any_ = true;
  last_ns_ = objects.acquired_ns;
  last_map_from_base_ = pose.map_from_base;
  last_objects_.clear();
  for (const Track& track : objects.tracks) {
    if (track.visible) last_objects_.push_back({track.id, track.kind, track.position_m});
  }
  return made;
}

}  // namespace omnifleet::global_merger
