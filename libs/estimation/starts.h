#pragma once

#include <string>
#include <vector>

#include "estimation/association.h"
#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Remembers what a robot sees in its newest frame.
void noteSight(RobotNode& robot, const Objects& frame, const std::vector<Seen>& seen);

/// Asks of every robot of these that nothing has confirmed yet whether it started where it is said to have:
/// do the others see the things that it sees, and it theirs, and they one another? Where more is missing than
/// is found, or nothing of theirs is seen, and in several frames one and the same other place makes nearly
/// everything agree, the robot is placed there. Of robots that contradict each other the one moves for which
/// more speaks (of two, nothing tells which is wrong); where then more robots err alike than do not, the map
/// goes back by that error, so that it lies where most starts say. (A start that is wrong by no more than
/// things are associated by is estimated with everything else.) Nothing is asked where something from outside
/// tells poses.
void checkStarts(FleetState& fleet, const std::vector<RobotNode*>& fresh);

/// Places a robot that nothing from outside has borne out yet where something from outside says that it
/// stands: `moved` (from the left) beside where its start has led it, to `covariance` (right perturbation).
/// Its published poses are published again, and its initial pose concluded once this pose is final.
void moveStart(FleetState& fleet, RobotNode& robot, const Pose2& moved, const Eigen::Matrix3d& covariance);

/// Whether a robot may still have started elsewhere, rather than have been carried since: its first frame is
/// in the window, and nothing from outside has ever agreed with it.
bool isOpen(const Start& start);

/// Enough has agreed with it: the start of a robot is asked about no more.
bool isConfirmed(const Start& start);

/// More of it is missing than is found.
bool isRefuted(const Start& start);

/// Likewise, and most robots fare better (else it is the pictures, not their
/// starts): it is not believed any more.
bool isContradicted(const FleetState& fleet, const RobotNode& robot);

/// In words, where a start that is believed is in doubt for long: others miss what it sees, or it what they
/// see, and nothing tells which of them are wrong; or too little is seen by both to confirm it. Else empty.
Message describeDoubt(const FleetState& fleet, const RobotNode& robot);

}  // namespace omnifleet::estimation
