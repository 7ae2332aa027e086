#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Stores the published estimate of a robot's newest frame.
void notePublished(RobotNode& robot, const PoseEstimate& estimate);

/// The configured initial pose is wrong and the right one unknown: publishes all poses so far as invalid.
void withdraw(FleetState& fleet, RobotNode& robot);

/// Before frames leave the window (`last`: at the end of a run, all of them): publishes again the poses that
/// moved since by more than the accuracy of maps (FleetState::revised), and all poses before a
/// relocalization. Then the correction of an initial pose is final, and one beyond its prior is reported
/// (FleetState::findings). Frames with a signature become places.
void revisePublished(FleetState& fleet, bool last);

}  // namespace omnifleet::estimation
