#pragma once

#include <Eigen/Core>

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Takes a robot over from an estimator in which it has been alone in a frame of its own: its keyframes, the
/// poses of all its frames so far, which are published again, and its newest pose. The robot is relocalized
/// here. @param covariance of map_from_own near the robot, right perturbation
void joinRobot(FleetState& fleet, RobotNode& robot, const FleetState& own, const Pose2& map_from_own,
               const Eigen::Matrix3d& covariance);

/// Likewise for a robot that this estimator has located by itself: takes over the poses of its frames only.
void adoptPath(FleetState& fleet, RobotNode& robot, const FleetState& own, const Pose2& map_from_own);

}  // namespace omnifleet::estimation
