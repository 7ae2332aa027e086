#pragma once

#include <optional>
#include <vector>

#include "tracking/own_motion.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

/// Checks the motion of a local map against the objects around the robot. Returns another motion if the
/// objects reject the given one: wheels slip, robots are kidnapped, speeds come in wrong units. Returns
/// nothing if the objects confirm the given motion or show no other one.
///
/// The reference objects are those known to be stationary when the robot last saw them. While nothing is
/// classified yet, all objects that are not known to be robots serve, at least three. The search places them
/// in this frame for these candidate motions: as given, at the last velocity, standing still, and every
/// motion that puts two reference objects on two blobs. Each candidate but the given one is fitted to the
/// outlines (Gauss–Newton, Huber).
/// A candidate replaces the given motion if its χ² is lower by 20 (more than one missing object, 16) and
/// lower than that of every other candidate by 8. Three matched objects are enough for any motion. Two are
/// enough within 0.5 m and 0.5 rad of the last velocity or of standing still. A small correction replaces the
/// given motion where all outlines are off alike. A difference that both covariances allow rejects nothing.
/// Without such a candidate, if the given motion leaps against the last velocity and no reference object is
/// where it predicts: the robot keeps its last velocity if one object confirms that; otherwise the motion is
/// unknown (`valid` is false).
///
/// `own` is the path before this frame. The result keeps `left_m`, `right_m` as the wheels reported them. Its
/// covariance is that of the fit. (Choi et al. 2014 §III.5 take the own motion from the wheels.)
std::optional<Motion> checkMotion(const std::vector<TrackState>& tracks, const LocalMap& now,
                                  const OwnMotion& own);

}  // namespace omnifleet::tracking
