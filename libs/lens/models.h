#pragma once

// The lens families behind Lens::make(); each throws options::Error for parameters it cannot invert.

#include <memory>
#include <string>

#include "lens/camera.h"

namespace omnifleet::lens {

inline constexpr double kDegree = 3.14159265358979323846 / 180.0;

/// Angles may pass the edge of the field of view by this much, so that its very edge survives a round trip.
inline constexpr double kEdgeSlack_rad = 1e-9;

/// Radially symmetric r = F·ρ(θ), θ from the optical axis, ρ per projection:
/// orthographic sin θ (Choi et al. 2014, eq. 6–7: x_u = x_d·L/F, L = F²/√(F² − r²), i.e. F·tan θ; undefined
/// for r ≥ F, so the field of view ends before 90° whatever fov_deg says), equidistant θ, equisolid 2 sin
/// θ/2, stereographic 2 tan θ/2, kannala_brandt θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹ (OpenCV's fisheye model,
/// continued beyond 90° through θ itself, which OpenCV does not do).
std::unique_ptr<const Lens> makeFisheye(const CameraModel& model);

/// OCamCalib's polynomial (Scaramuzza et al. 2006), see CameraModel::distortion.
std::unique_ptr<const Lens> makeOcam(const CameraModel& model);

/// OpenCV's pinhole with k1, k2, p1, p2, k3 (and, of its rational model, k4, k5, k6). Seen are points in
/// front of the camera within the radius up to which the radial polynomial increases.
std::unique_ptr<const Lens> makePinhole(const CameraModel& model);

/// u = cx + fx·atan2(x, z), v = cy + fy·atan2(y, √(x² + z²)): a full panorama, the optical axis in its
/// middle.
std::unique_ptr<const Lens> makeEquirectangular(const CameraModel& model);

/// "…: cannot be inverted beyond A° from the optical axis, fov_deg F needs B°"
std::string breakMessage(const CameraModel& model, double break_rad);

/// Full angle, degrees, up to which the parameters can be inverted, not beyond the farthest image corner. For
/// calibrations that do not say their field of view.
double widestFovDeg(CameraModel model);

/// The intrinsics of an OpenCV FileStorage (.xml, .yml), ROS camera_info or Kalibr camchain; false where the
/// file is none of them. An image size that the file does not say is left as it is in `model`.
bool readForeignCalibration(const std::string& path, CameraModel& model);

}  // namespace omnifleet::lens
