#pragma once

#include <Eigen/Core>

#include "lens/spread.h"
#include "observation/boundary.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

/// The boundary as a camera without this calibration error would have seen it, first order (cameraField()).
/// Unchanged for a laser (camera_height_m 0).
void correctBoundary(const Boundary& seen, const Eigen::Vector4d& error, double camera_height_m,
                     const lens::Spread& lens, Boundary& corrected);

/// Displacement of each beam's point per unit calibration error. Empty for a laser.
scan::BeamFields beamFields(const scan::LineScan& scan, double camera_height_m, const lens::Spread& lens);

}  // namespace omnifleet::estimation
