#pragma once

#include <Eigen/Core>

#include "estimation/fleet_state.h"
#include "estimation/troubles.h"

namespace omnifleet::estimation {

/// After the solution of a robot's newest frame: updates the state of its localisation, searches its place
/// among the keyframes where that is needed, and puts it there.
void localize(FleetState& fleet, RobotFrame& frame);

/// Covariance of what people may have done to a robot whose observations contradict its pose for several
/// frames, right perturbation.
Eigen::Matrix3d suspectedMove(const RobotNode& robot);

}  // namespace omnifleet::estimation
