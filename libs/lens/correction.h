#pragma once

#include <string>

#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::lens {

/// Which lens carries points of an image to the floor: the sensor's own, or that of Choi et al. 2014, §III.4.
struct CorrectionOptions {
  std::string projection = "sensor";  ///< sensor | orthographic (eq. 6–7 in the place of the sensor's lens)
  double focal_px = 0.0;  ///< pixels, F of eq. 6–7; 0: the one that fits the sensor's lens best on the floor
  double fit_range_m = 1.5;  ///< metres, floor up to here is fitted

  static CorrectionOptions read(const options::Section& section);
};

/// The camera by which points are corrected. "orthographic": same place and principal point, x_u = x_d·L/F
/// with L = F²/√(F² − r²) (Choi eq. 6–7), no distortion, at most 180°; it gives nothing for r ≥ F, where
/// eq. 7 has no value.
Camera correctionCamera(const Camera& sensor, const CorrectionOptions& options);

/// F of eq. 6–7 whose floor points are nearest, in the mean square, to those of the sensor's own lens up to
/// `range_m` around its foot: what calibrating the paper's model on a floor of known grid comes to. Points
/// with r ≥ F count as wrong by the whole range. Throws options::Error where the camera sees no such floor.
double fittedFocalPx(const Camera& sensor, double range_m);

}  // namespace omnifleet::lens
