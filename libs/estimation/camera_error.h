#pragma once

#include <bitset>
#include <string>

#include "observation/camera_error.h"
#include "options/options.h"

namespace omnifleet::estimation {

using omnifleet::CameraError;
using CameraCovariance = Eigen::Matrix<double, kCameraErrors, kCameraErrors>;

/// Priors: what calibrations are worth.
struct CameraOptions {
  bool estimate = true;         ///< false: cameras are as their calibrations say
  double focal_sigma = 0.003;   ///< 1, relative
  double height_sigma = 0.002;  ///< 1, relative; outlines a little too large look much like it. Of the middle
                                ///< of a Cauchy prior: some rulers were held elsewhere (kHeightLoss)
  double tilt_sigma_rad = 0.0035;    ///< rad, roll and pitch each (0.2°)
  double contour_sigma_rad = 0.002;  ///< rad, 0.3 pixels at 640 × 480: sharp, blurred, compressed

  static CameraOptions read(const options::Section& section);
  CameraError sigma() const;
  /// What the prior is worth to whoever errs by so much: of the height less, the farther off it is.
  CameraError sigmaAt(const CameraError& error) const;

  static constexpr double kHeightLoss = 1.0;  ///< σ, scale of the Cauchy loss on the height's prior
  static constexpr Eigen::Index kHeight = 1;  ///< of CameraError
};

/// What of an estimated error must be believed of the camera: focal length, height, roll, pitch. A
/// calibration is right or it errs as its prior says, each as likely before anything is seen; the estimate,
/// which takes the second for granted, counts by the probability of it afterwards. That of a right one shows
/// in the estimate itself: how much less than before zero is expected (the density ratio of Savage and
/// Dickey; Dickey 1971). So the published error of a well calibrated camera is zero within its noise, and of
/// another the estimate. How large outlines are seen is a nuisance of both; what they have in common beside
/// that, about a tenth of a pixel, does not become less with their number and is added to the noise where
/// that is asked.
Eigen::Vector4d believedError(const CameraError& error, const CameraCovariance& covariance,
                              const CameraOptions& options);

/// What is wrong with a camera by what was seen alone: the prior, which an error that is worth telling
/// contradicts, is taken out of the estimate. Calibration minus truth.
class CameraFinding {
 public:
  /// Focal length, height, roll, pitch.
  using Quantities = std::bitset<4>;

  CameraFinding(const CameraError& error, const CameraCovariance& covariance, const CameraOptions& options);
  /// Those that are wrong beyond doubt: more than 5 σ from zero, for it is asked often.
  Quantities wrong() const { return beyond(5.0); }
  /// Those of which it may still be said: more than 3 σ.
  Quantities possible() const { return beyond(3.0); }
  /// By how many σ a quantity is found beside what it is.
  double deviation(int quantity, double truth) const {
    return (estimate_(quantity) - truth) / sigma_(quantity);
  }
  /// Those given, each with its value ± σ.
  std::string describe(const Quantities& which) const;
  /// Those given by name alone.
  static std::string name(const Quantities& which);

 private:
  Quantities beyond(double sigmas) const;
  Eigen::Vector4d estimate_ = Eigen::Vector4d::Zero(), sigma_ = Eigen::Vector4d::Ones();
};

/// Larger by how much two errors displace things differently as seen from the camera: metres per metre of its
/// height, of a point three heights away, at most.
double displacement(const Eigen::Vector4d& error, const lens::Spread& lens);

}  // namespace omnifleet::estimation
