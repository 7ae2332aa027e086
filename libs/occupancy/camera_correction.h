#pragma once

#include "lens/spread.h"
#include "occupancy/contribution.h"

namespace omnifleet::occupancy {

/// The contribution that a camera without calibration error would have made. Corrects supports, positions,
/// camera height, ranges and points for the camera error (observation/camera_error.h), to first order, as it
/// is estimated. Rays keep their bearings: tilt displaces them sideways by the camera height times the tilt,
/// a few millimetres. Computed in doubles and rounded to 0.1 mm, so that machines whose arithmetic differs in
/// the last bit agree except for one value in 10¹⁰. Contributions of a laser (height 0) and contributions
/// without error are returned unchanged.
Contribution withoutCameraError(const Contribution& seen, const CameraErrorPpm& error,
                                const lens::Spread& spread);

}  // namespace omnifleet::occupancy
