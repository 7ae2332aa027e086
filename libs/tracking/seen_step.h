#pragma once

#include <optional>
#include <vector>

#include "tracking/own_motion.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

/// How the robot has gone since its last frame by what stands around it, where that refutes the motion that
/// the frame carries: wheels slip, hands carry robots, speeds come in other units. Nothing where what stands
/// bears the motion out, or shows no other one.
///
/// What stood where it was known to when the robot saw last (while nothing has been judged yet: what is not
/// known to be a robot, three at least) is looked for in this frame, as if the robot had gone as told, had
/// gone on as before, had stood, or had gone so that two of these things lie where two blobs are. Each such
/// motion but the told one is fitted to the outlines (Gauss–Newton, Huber). One that explains so much more
/// than the told one as two things not there count, and clearly more than any other, is how the robot has
/// gone: anywhere by three things, within half a metre and half a radian of going on or of standing by two.
/// So is one beside the told one where all outlines are off alike. What both covariances allow refutes
/// nothing. Where there is none, and the told motion leaps from going on and nothing is where it has it, the
/// robot goes on if one thing bears that out; else the motion is not known (`valid` is false).
///
/// `own` is before this frame. The motion keeps `left_m`, `right_m` as the wheels told them; its covariance
/// is that of the fit. (Choi et al. 2014 §III.5 take the own motion as the wheels tell it.)
std::optional<Motion> seenStep(const std::vector<TrackState>& tracks, const LocalMap& now,
                               const OwnMotion& own);

}  // namespace omnifleet::tracking
