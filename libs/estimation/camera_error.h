#pragma once

// How a camera that looks at the floor errs against its calibration, and what that does to what it sees on
// the floor (RECIPES "Estimator": focal length and tilt are estimated where observable). The lens itself is
// not asked: its focal error is taken as that of an equidistant one, which is 10 % (equisolid) to 20 %
// (stereographic) off at 65°, of an error that is small itself.

#include <Eigen/Core>

#include "options/options.h"

namespace omnifleet::estimation {

/// (focal length ε 1, height over the floor η 1, roll rad, pitch rad): calibrated value minus true one; ε and
/// η relative to the true one.
using CameraError = Eigen::Vector4d;

/// Priors: what calibrations are worth.
struct CameraOptions {
  bool estimate = true;            ///< false: cameras are as their calibrations say
  double focal_sigma = 0.003;      ///< 1, relative
  double height_sigma = 0.002;     ///< 1, relative; outlines half a millimetre too large look like as much
  double tilt_sigma_rad = 0.0035;  ///< rad, roll and pitch each (0.2°)

  static CameraOptions read(const options::Section& section);
  CameraError sigma() const;
};

/// A point p of the floor, from the camera's foot in base_link, is seen at p + field(p)·error. First order,
/// with ρ = |p|, u = ρ/H and t = (−pitch, roll):
///   focal  −ε·H·(1 + u²)·atan(u)·p/ρ      (θ′ = θ·(1 − ε), ρ = H·tan θ)
///   height  η·p                           (H′ = H·(1 + η))
///   tilt    H·t + p·(p·t)/H               (the ray (p, −H) turned about the base's axes)
/// The tops of things are seen by the same rays, so it holds for whole silhouettes. Zero for a laser (H = 0).
Eigen::Matrix<double, 2, 4> cameraField(const Eigen::Vector2d& p_m, double camera_height_m);

}  // namespace omnifleet::estimation
