#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

// Where nothing from outside tells where `map` is, it is where its founder started; but how a fleet's things
// stand to one another is soon known far better than how they stand to the first second of one robot, which
// every later pose and its covariance would hang on. So the start becomes a variable of its own, and once
// three named points are known, the frame is held by them: it is where they as a whole are thought to be (the
// datum of a free network by inner constraints; Baarda 1973, Triggs et al. 2000, §9). What is learned
// later of the start moves the start, not the map, and covariances are those against the points as a whole.
// What they are against goes with them (PoseEstimate::datum): errors against the start and errors against the
// points are not alike, and can be compared with the truth only after each was brought onto it.

/// Derivatives of a variable by a shift of everything along x and y of map and a turn about its origin; empty
/// where these do not move it. Poses, points and landmarks are told by their sizes.
Eigen::MatrixXd commonMotions(const Eigen::VectorXd& value);

/// The first pose of the robot that founds the map: `start_from_base` from its start, with that covariance.
void foundMap(FleetState& fleet, VariableId pose, const Pose2& start_from_base,
              const Eigen::Matrix3d& covariance);

/// To be called around what marginalises points.
void releaseFrame(FleetState& fleet);
void holdFrame(FleetState& fleet);

}  // namespace omnifleet::estimation
