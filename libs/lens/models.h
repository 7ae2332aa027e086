#pragma once

// The lens families behind Lens::make(). Each throws options::Error for parameters that it cannot invert.

#include <memory>
#include <string>

#include "lens/camera.h"

namespace omnifleet::lens {

inline constexpr double kDegree = 3.14159265358979323846 / 180.0;

/// Angles may exceed the edge of the field of view by this much, so that the edge itself survives a round
/// trip.
inline constexpr double kEdgeSlack_rad = 1e-9;

/// Radially symmetric lens r = F·ρ(θ), θ from the optical axis, then the affine map (fx, skew; 0, fy) of the
/// pixels. ρ per projection: orthographic: sin θ. Choi et al. 2014, eq. 6–7: x_u = x_d·L/F, L = F²/√(F² −
/// r²), i.e. F·tan θ. Undefined for r ≥ F, so the field of view ends before 90°, independent of fov_deg.
/// equidistant: θ
/// equisolid: 2 sin θ/2
/// stereographic: 2 tan θ/2
/// kannala_brandt: θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹. OpenCV's fisheye model, continued beyond 90° through θ,
/// which OpenCV does not do.
std::unique_ptr<const Lens> makeFisheye(const CameraModel& model);

/// Polynomial of OCamCalib (Scaramuzza et al. 2006), see CameraModel::distortion.
std::unique_ptr<const Lens> makeOcam(const CameraModel& model);

/// OpenCV's pinhole model with k1, k2, p1, p2, k3 (and k4, k5, k6 of its rational model). It sees points in
/// front of the camera, within the radius up to which the radial polynomial increases.
std::unique_ptr<const Lens> makePinhole(const CameraModel& model);

/// A full panorama with the optical axis in its centre: u = cx + fx·atan2(x, z), v = cy + fy·atan2(y, √(x² +
/// z²)).
std::unique_ptr<const Lens> makeEquirectangular(const CameraModel& model);

/// "…: cannot be inverted beyond A° from its axis; fov_deg F needs B°"
std::string breakMessage(const CameraModel& model, double break_rad);

/// Full angle (degrees) up to which the parameters can be inverted, limited to the farthest image corner.
/// Used for calibrations that do not state their field of view.
double widestFovDeg(CameraModel model);

}  // namespace omnifleet::lens
