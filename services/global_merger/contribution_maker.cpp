#include <cmath>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

KeyframeOptions KeyframeOptions::read(const options::Section& section) {
  KeyframeOptions o;
  section.read("distance_m", o.distance_m, {0.0, 100.0});
  section.read("rotation_rad", o.rotation_rad, {0.0, 6.3});
  section.read("interval_s", o.interval_s, {0.0, 3600.0});
  section.read("min_interval_s", o.min_interval_s, {0.0, 3600.0});
  section.finish();
  return o;
}

std::optional<ContributionMaker::Made> ContributionMaker::make(const Objects& objects,
                                                               const PoseEstimate& pose) {
  if (objects.state != FrameState::kOk || !pose.valid || !pose.map_from_base.isFinite()) return std::nullopt;
  if (objects.acquired_ns != pose.acquired_ns || objects.robot != pose.robot) return std::nullopt;
  if (any_) {
    if (objects.acquired_ns <= last_ns_) return std::nullopt;
    const double passed_s = static_cast<double>(objects.acquired_ns - last_ns_) * 1e-9;
    const Pose2 way = last_map_from_base_.inverse() * pose.map_from_base;
    const bool moved =
        way.translation().norm() >= options_.distance_m || std::abs(way.theta_rad) >= options_.rotation_rad;
    if (passed_s < options_.min_interval_s || (!moved && passed_s < options_.interval_s)) return std::nullopt;
  }
  Made made{occupancy::makeContribution(objects), occupancy::makeKeyframePose(pose)};
  if (!made.pose.valid) return std::nullopt;
  any_ = true;
  last_ns_ = objects.acquired_ns;
  last_map_from_base_ = pose.map_from_base;
  return made;
}

}  // namespace omnifleet::global_merger
