#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Stores the published estimate of a robot's newest frame.
void notePublished(RobotNode& robot, const PoseEstimate& estimate);

/// The configured initial pose is wrong and the right one unknown: publishes all poses so far as invalid.
void withdraw(FleetState& fleet, RobotNode& robot);

/// The keyframe that the scan of a frame met or, without a match, the latest one.
std::optional<KeyframeMap::Id> keyframeOf(const RobotNode& robot, const Step& step);

/// A frame with a signature becomes a node of the topological map when its pose is final.
/// @param keyframe to which the place is relative, if any @param is_last of the run: it always becomes one,
/// if there are any
void rememberPlace(FleetState& fleet, RobotNode& robot, const Step& step, const Pose2& map_from_base,
                   const std::optional<KeyframeMap::Id>& keyframe, bool is_last);

/// Before frames leave the window (`last`: at the end of a run, all of them): publishes again the poses that
/// moved since by more than the accuracy of maps (FleetState::revised), and all poses before a
/// relocalization. Then the correction of an initial pose is final, and one beyond its prior is reported
/// (FleetState::findings). Frames with a signature become places.
void revisePublished(FleetState& fleet, bool last);

}  // namespace omnifleet::estimation
