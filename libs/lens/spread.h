#pragma once

#include "lens/camera.h"

namespace omnifleet::lens {

/// Radial projection of a lens in one number: r = F·sin(√κ·θ)/√κ, θ from the axis. κ is 1 for the
/// orthographic projection, 1/4 for equisolid, 0 for equidistant. For κ < 0 (sinh), it matches the
/// stereographic projection within 3 % up to 75°. It gives the angle that corresponds to an error of one
/// pixel, which differs between image centre and rim.
class Spread {
 public:
  Spread() = default;  ///< equidistant
  explicit Spread(double kappa);
  /// κ that reproduces r/r′ of the camera at 60° from the axis, or at 90 % of half its field of view if that
  /// is less (pinhole: at 30°).
  static Spread of(const Camera& camera);

  double kappa() const { return kappa_; }
  double radius(double theta_rad) const;  ///< r/F
  double slope(double theta_rad) const;   ///< its derivative, at least 0.05

 private:
  double kappa_ = 0.0, root_ = 0.0;  ///< root_: √|κ|
};

}  // namespace omnifleet::lens
