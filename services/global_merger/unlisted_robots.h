#pragma once

#include <vector>

#include "global_merger/candidates.h"

namespace omnifleet::global_merger {

/// Identifies robots that publish nothing. They are recognized by their motion only, so a robot that sees one
/// at rest takes it for an obstacle. A track of one robot that was seen to drive and is classified as robot
/// remains at its last place. Tracks of other robots that are mostly seen there from then on are the same
/// robot: their kind becomes kRobot. (Interpretation: Choi 2014, III.6 recognizes robots by motion in one
/// robot's view; here the observation of one robot holds for all.)
void findUnlistedRobots(std::vector<Candidate>& candidates);

}  // namespace omnifleet::global_merger
