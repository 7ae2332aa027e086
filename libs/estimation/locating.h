#pragma once

#include <vector>

#include "estimation/fleet_state.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// Places an unlocated robot by a mutual sighting: a located robot sees a body of its shape at P, and it sees
/// that robot's body at q; the two agree in distance, so position and heading follow. Hypotheses are scored
/// by how many of its silhouettes then fall onto known robots and landmarks; the best is taken when it is
/// unrivalled, and where that is but the other robot, when it has been so for a while. Returns whether it was
/// placed.
bool locateBySightings(FleetState& fleet, RobotNode& lost, const Objects& frame,
                       const std::vector<const Objects*>& frames);

}  // namespace omnifleet::estimation
