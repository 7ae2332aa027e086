#pragma once

// Errors of a camera's calibration, and the displacement they cause in what the camera sees on the floor. The
// localizer estimates them where they are observable (docs/methods/localizer.md).

#include <Eigen/Core>

#include "lens/spread.h"

namespace omnifleet {

/// Calibrated value minus true value: focal length ε and height over the floor η (both relative to the true
/// value), roll and pitch (rad). The fifth entry is how much too large outlines are seen on every side, as an
/// angle of the ray (rad; in the image centre: pixels ÷ F). Blur, compression and a tone curve move every
/// contour by part of a pixel. Without this entry, that would be attributed to a wrong height or focal
/// length.
using CameraError = Eigen::Matrix<double, 5, 1>;
constexpr int kCameraErrors = CameraError::RowsAtCompileTime;

/// A floor point p, given from the foot of the camera in base_link, is seen at p + field(p)·error. First
/// order, with ρ = |p|, u = ρ/H and t = (−pitch, roll):
/// - focal length: −ε·H·(1 + u²)·(r/r′)·p/ρ, because r(θ′) = r(θ)·(1 − ε) and ρ = H·tan θ. An equidistant
/// lens has r/r′ = θ.
/// - height: η·p, because H′ = H·(1 + η).
/// - tilt: H·t + p·(p·t)/H, because the ray (p, −H) turns about the axes of base_link.
/// The same rays show the tops of objects, so the field holds for whole silhouettes. Zero for a laser (H =
/// 0).
Eigen::Matrix<double, 2, 4> cameraField(const Eigen::Vector2d& p_m, double camera_height_m,
                                        const lens::Spread& lens);

/// How far the tangent with unit normal n, which touches an outline at p, moves outwards when the outline is
/// seen too large by 1 rad: |Jᵀ·n|. J is the derivative of the floor point by r/F: H·(1 + u²)/r′ along p and
/// H·u/r across. Metres per radian. Zero for a laser.
double contourField(const Eigen::Vector2d& p_m, const Eigen::Vector2d& normal, double camera_height_m,
                    const lens::Spread& lens);

/// Support value of a silhouette about the foot of the camera in one of K directions, φ = 2πk/K, and the
/// values in the directions before and after it. NaN where unknown.
struct SupportTriple {
  double before_m, here_m, after_m;
};

/// Derivative of that support value by the camera error. It is the field at the supporting point, which is
/// where its half-plane meets those of its neighbours.
CameraError supportByCameraError(const SupportTriple& b, std::size_t direction, std::size_t directions,
                                 double camera_height_m, const lens::Spread& lens);

}  // namespace omnifleet
