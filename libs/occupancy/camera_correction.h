#pragma once

#include "lens/spread.h"
#include "occupancy/contribution.h"

namespace omnifleet::occupancy {

/// What a keyframe would have seen had the camera been as its calibration says: supports, places, heights of
/// the camera, ranges and points of a contribution without the camera's error (observation/camera_error.h; to
/// first order, as it is estimated). Rays keep their bearings: what tilt moves them aside, the camera's
/// height times the tilt, is a few millimetres. Computed in doubles and rounded to 0.1 mm, so that machines
/// whose arithmetic differs in the last bit agree but for a value in ten thousand million. A laser's
/// contribution (height 0) and any with no error stay as they are.
Contribution withoutCameraError(const Contribution& seen, const CameraErrorPpm& error,
                                const lens::Spread& spread);

}  // namespace omnifleet::occupancy
