#pragma once

#include <vector>

#include "global_merger/candidates.h"

namespace omnifleet::global_merger {

/// Robots that publish nothing are told by their motion alone: who sees one only when it stands takes it for
/// an obstacle. A track of one robot's that was seen to drive, and is a robot, stands where it was seen last;
/// tracks of others that are mostly seen there from then on are that robot: their kind becomes kRobot.
/// (Reading: Choi 2014, III.6 tells robots by motion in one robot's view; what one robot saw holds for all.)
void tellStrangers(std::vector<Candidate>& candidates);

}  // namespace omnifleet::global_merger
