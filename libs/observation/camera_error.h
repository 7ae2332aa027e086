#pragma once

// How a camera that looks at the floor errs against its calibration, and what that does to what it sees on
// the floor (docs/methods.md, "Estimator": focal length and tilt are estimated where observable).

#include <Eigen/Core>

#include "lens/spread.h"

namespace omnifleet {

/// (focal length ε 1, height over the floor η 1, roll rad, pitch rad): calibrated value minus true one; ε and
/// η relative to the true one. Then how far outlines are seen too large all round, rad of the ray's angle:
/// blur, compression and a tone curve move every contour by a part of a pixel, which would otherwise be taken
/// for a wrong height or focal length. (Pixels ÷ F: rad in the middle of the picture.)
using CameraError = Eigen::Matrix<double, 5, 1>;
constexpr int kCameraErrors = CameraError::RowsAtCompileTime;

/// A point p of the floor, from the camera's foot in base_link, is seen at p + field(p)·error. First order,
/// with ρ = |p|, u = ρ/H and t = (−pitch, roll):
///   focal  −ε·H·(1 + u²)·r/r′·p/ρ         (r(θ′) = r(θ)·(1 − ε), ρ = H·tan θ; r/r′ of an equidistant lens is
///   θ) height  η·p                           (H′ = H·(1 + η)) tilt    H·t + p·(p·t)/H               (the ray
///   (p, −H) turned about the base's axes)
/// The tops of things are seen by the same rays, so it holds for whole silhouettes. Zero for a laser (H = 0).
Eigen::Matrix<double, 2, 4> cameraField(const Eigen::Vector2d& p_m, double camera_height_m,
                                        const lens::Spread& lens);

/// By how much the tangent with unit normal n, which touches an outline at p, moves out where the outline is
/// seen too large by 1 rad: |Jᵀ·n|, J the floor by r/F, H·(1 + u²)/r′ along p and H·u/r across. Metres per
/// radian; zero for a laser.
double contourField(const Eigen::Vector2d& p_m, const Eigen::Vector2d& normal, double camera_height_m,
                    const lens::Spread& lens);

/// A silhouette's support about the camera's foot in one of K directions, φ = 2πk/K, with those before and
/// after it; NaN where not known.
struct SupportTriple {
  double before_m, here_m, after_m;
};

/// Derivative of that support by the camera's error: the field at the point that supports it, which is where
/// its half-plane meets the neighbours'.
CameraError supportByCameraError(const SupportTriple& b, std::size_t direction, std::size_t directions,
                                 double camera_height_m, const lens::Spread& lens);

}  // namespace omnifleet
