#pragma once

#include <string>

#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::lens {

/// Projection model that maps image points to the floor: that of the sensor, or that of Choi et al. 2014,
/// §III.4.
struct CorrectionOptions {
  std::string projection = "sensor";  ///< sensor | orthographic (eq. 6–7 instead of the sensor's projection)
  double focal_px =
      0.0;  ///< pixels, F of eq. 6–7; 0: the value that fits the sensor's projection best on the floor
  double fit_range_m = 1.5;  ///< metres, range of the floor in this fit

  static CorrectionOptions read(const options::Section& section);
};

/// The camera that corrects points. "orthographic": same pose and principal point, x_u = x_d·L/F with L =
/// F²/√(F² − r²) (Choi eq. 6–7), no distortion, at most 180°. For r ≥ F, where eq. 7 has no value, it returns
/// nothing.
Camera correctionCamera(const Camera& sensor, const CorrectionOptions& options);

/// F of eq. 6–7 whose floor points have the least mean squared distance to those of the sensor's projection,
/// up to `range_m` around the foot of the camera. This equals a calibration of the paper's model on a floor
/// with a known grid. Points with r ≥ F count with an error of the whole range. Throws options::Error if the
/// camera sees no such floor.
double fittedFocalPx(const Camera& sensor, double range_m);

}  // namespace omnifleet::lens
