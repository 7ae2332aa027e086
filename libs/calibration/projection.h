#pragma once

#include <cmath>

#include "lens/camera.h"

namespace omnifleet::calibration {

/// Intrinsics as one parameter block of the solver; unused entries are fixed.
/// [fx, fy, cx, cy, d0 … d4]: closed forms use no d; kannala_brandt d0–d3 = k1–k4; pinhole k1, k2, p1, p2,
/// k3.
/// ocam: [c, e, cx, cy, d, ss0, ss2·s, ss3·s², ss4·s³] with s = kOcamScale_px (equal magnitudes) and ss1 = 0.
inline constexpr int kIntrinsics = 9;
inline constexpr double kOcamScale_px = 500.0;

/// The lens models of libs/lens as differentiable functions: pixel of a ray in the optical frame. The
/// equations are those of lens::Lens (a test compares them), but without a limit of the field of view, so
/// that iterations may exceed it. False if the ray has no image.
template <typename T>
class Projector {
 public:
  Projector(lens::Projection projection, const T* intrinsics) : projection_(projection), p_(intrinsics) {}

  bool project(const T* ray, T* pixel) const {
    using std::atan2;
    using std::sqrt;
    if (projection_ == lens::Projection::kPinhole) return pinhole(ray, pixel);
    const T side = sqrt(ray[0] * ray[0] + ray[1] * ray[1] + T(1e-30));
    const T theta = atan2(side, ray[2]);
    if (projection_ == lens::Projection::kOcam) return ocam(ray, side, theta, pixel);
    const T scale = radius(theta) / side;
    pixel[0] = p_[2] + p_[0] * scale * ray[0];
    pixel[1] = p_[3] + p_[1] * scale * ray[1];
    return true;
  }

 private:
  T radius(const T& theta) const {
    using std::sin;
    using std::tan;
    const T t = theta * theta;
    switch (projection_) {
      case lens::Projection::kOrthographic:
        return sin(theta);
      case lens::Projection::kEquisolid:
        return T(2.0) * sin(T(0.5) * theta);
      case lens::Projection::kStereographic:
        return T(2.0) * tan(T(0.5) * theta);
      case lens::Projection::kKannalaBrandt:
        return theta * (T(1.0) + t * (p_[4] + t * (p_[5] + t * (p_[6] + t * p_[7]))));
      default:
        return theta;
    }
  }

  bool pinhole(const T* ray, T* pixel) const {
    if (!(ray[2] > T(1e-6))) return false;
    const T x = ray[0] / ray[2], y = ray[1] / ray[2], s = x * x + y * y;
    const T radial = T(1.0) + s * (p_[4] + s * (p_[5] + s * p_[8]));
    pixel[0] = p_[2] + p_[0] * (x * radial + T(2.0) * p_[6] * x * y + p_[7] * (s + T(2.0) * x * x));
    pixel[1] = p_[3] + p_[1] * (y * radial + p_[6] * (s + T(2.0) * y * y) + T(2.0) * p_[7] * x * y);
    return true;
  }

  /// z(ρ), z forward; z and ρ in pixels.
  T depth(const T& rho) const {
    const T q = rho / T(kOcamScale_px);
    return -(p_[5] + rho * q * (p_[6] + q * (p_[7] + q * p_[8])));
  }
  T depthSlope(const T& rho) const {
    const T q = rho / T(kOcamScale_px);
    return -(q * (T(2.0) * p_[6] + q * (T(3.0) * p_[7] + q * T(4.0) * p_[8])));
  }

  /// Solves ρ·cos θ − z(ρ)·sin θ = 0 for ρ by Newton's method to convergence. The last steps propagate the
  /// exact derivatives by all parameters (implicit function theorem).
  bool ocam(const T* ray, const T& side, const T& theta, T* pixel) const {
    using std::abs;
    using std::cos;
    using std::sin;
    const T c = cos(theta), s = sin(theta);
    T rho = -p_[5] * theta;
    for (int i = 0; i < 40; ++i) {
      const T step = (rho * c - depth(rho) * s) / (c - depthSlope(rho) * s);
      rho -= step;
      if (abs(step) < T(1e-11) && i > 3) break;
    }
    if (!(rho >= T(-1e-6)) || !(rho < T(1e5))) return false;
    const T x = rho * ray[1] / side, y = rho * ray[0] / side;  // x along rows (down), y along columns (right)
    pixel[0] = p_[2] + p_[1] * x + y;
    pixel[1] = p_[3] + p_[0] * x + p_[4] * y;
    return true;
  }

  lens::Projection projection_;
  const T* p_;
};

}  // namespace omnifleet::calibration
