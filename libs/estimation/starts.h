#pragma once

#include <string>
#include <vector>

#include "estimation/association.h"
#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// What a robot sees at one time.
struct Sight {
  RobotNode* robot;
  const Objects* objects;
  const std::vector<Seen>* seen;
};

/// Asks of every robot that nothing has confirmed yet whether it started where it is said to have: do other
/// robots see the things that it sees, and it theirs, and one another? Where more is missing than is found,
/// and in several frames one and the same other place makes nearly everything agree, the robot is placed
/// there; of two robots that contradict each other the one that agrees with fewer, else the later of them.
/// A start that is wrong by no more than things are associated by is estimated with everything else and not
/// told here. Returns the robots that were placed anew.
std::vector<RobotNode*> checkStarts(FleetState& fleet, const std::vector<Sight>& sights);

/// Enough has agreed with it: the start of a robot is asked about no more.
bool isConfirmed(const Start& start);

/// In words, what is wrong with a start.
std::string tellMoved(const Pose2& moved, const Pose2& told);

}  // namespace omnifleet::estimation
