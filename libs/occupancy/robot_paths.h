#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "occupancy/body_mask.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::occupancy {

/// The pose in integers; nothing for null (ContributionStore::poseOf).
std::optional<IntegerPose> integerPoseOf(const KeyframePose* pose);

/// Poses of the robots over time, from their keyframe poses in the map, in integers. A robot whose poses are
/// in another frame has no place here.
class RobotPaths {
 public:
  RobotPaths(const ContributionStore& store, TimeNs hold_ns, TimeNs max_gap_ns)
      : store_(store), hold_ns_(hold_ns), max_gap_ns_(max_gap_ns) {}

  /// Pose at a time: the keyframe pose of exactly that time; else interpolated if the poses before and after
  /// are at most `max_gap` apart; else the nearer one within `hold`; else nothing.
  std::optional<IntegerPose> at(const std::string& robot, TimeNs time_ns) const;

  /// First and last time at which a change of the robot's pose at `time_ns` has an effect.
  std::pair<TimeNs, TimeNs> influence(const std::string& robot, TimeNs time_ns) const;

 private:
  std::optional<IntegerPose> poseOf(const ContributionStore::Keyframe& keyframe) const {
    return integerPoseOf(store_.poseOf(keyframe));
  }

  const ContributionStore& store_;
  TimeNs hold_ns_, max_gap_ns_;
};

}  // namespace omnifleet::occupancy
