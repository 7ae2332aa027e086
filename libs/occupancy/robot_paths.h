#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "occupancy/body_mask.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::occupancy {

/// Where robots stood, from their valid keyframe poses, in integers.
class RobotPaths {
 public:
  RobotPaths(const ContributionStore& store, TimeNs hold_ns, TimeNs max_gap_ns)
      : store_(store), hold_ns_(hold_ns), max_gap_ns_(max_gap_ns) {}

  /// At the very time; else interpolated where the poses before and after are at most `max_gap` apart; else
  /// the nearer one within `hold`; else nothing.
  std::optional<Standing> at(const std::string& robot, TimeNs time_ns) const;

  /// First and last time at which a change of the robot's pose at `time_ns` can matter.
  std::pair<TimeNs, TimeNs> influence(const std::string& robot, TimeNs time_ns) const;

 private:
  const ContributionStore& store_;
  TimeNs hold_ns_, max_gap_ns_;
};

/// The pose as integers; nothing where it is invalid or out of bounds.
std::optional<Standing> standingOf(const std::optional<KeyframePose>& pose);

}  // namespace omnifleet::occupancy
