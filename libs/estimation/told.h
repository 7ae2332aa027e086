#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Remembers what is being reported of a robot's newest frame.
void noteTold(RobotNode& robot, const PoseEstimate& estimate);

/// A robot is not where it is said to be, and where it is nobody knows: nothing that was told of it holds.
void withdraw(FleetState& fleet, RobotNode& robot);

/// Before frames leave the window (`last`: at the end of a run, all of them): where their poses have become
/// others than was told by more than maps are exact to, they are to be told anew (FleetState::revised); so is
/// all that came before a robot was placed anew. What a start was wrong by is then known for good and told
/// where it is more than starts are known to (FleetState::findings).
void reviseTold(FleetState& fleet, bool last);

}  // namespace omnifleet::estimation
