#pragma once

#include <optional>
#include <vector>

#include "estimation/association.h"
#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// How what a robot sees goes with where its motion has put it.
struct Whereabouts {
  int things = 0;                  ///< whole silhouettes
  int matches = 0;                 ///< of them known ones, where they should be
  int missing = 0;                 ///< known ones in plain sight that it does not see
  std::optional<Pose2> elsewhere;  ///< map_from_base, where much more is where it should be, and nowhere else

  bool fit() const { return matches >= 2 && 2 * matches >= things; }
};

/// Wheels slip and people carry robots; what stands around a robot tells where it is then. Pairs of its
/// silhouettes are held against pairs of known things at the same distance. Two that agree are enough within
/// a slip's reach (a longer one where the robot has seen nothing for a while), three anywhere. `peers`: with
/// the other robots as known things, as they may have slipped themselves.
Whereabouts lookAround(const FleetState& fleet, const RobotNode& robot, const std::vector<Seen>& seen,
                       bool peers);

/// A lost robot's newest frame: two things that fit a place tell no more than that it may be there. But a
/// place that goes on to explain what is seen, while the robot drives, where nothing is missing and no other
/// explains half as much, is where it is.
std::optional<Pose2> followClaims(const FleetState& fleet, RobotNode& robot, const std::vector<Seen>& seen);

/// A frame's part of the way that a robot has gone without seeing anything; before it is associated.
void followUnseen(FleetState& fleet, RobotNode& robot, bool sees);
/// Whether a robot is elsewhere than the way that it has gone unseen says.
bool wasCarried(const FleetState& fleet, const RobotNode& robot);

/// Puts a robot's newest frame elsewhere and lets its motion say no more than that it was so much.
void jumpTo(FleetState& fleet, RobotNode& robot, const Pose2& map_from_base);

}  // namespace omnifleet::estimation
