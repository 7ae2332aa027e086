#include "lens/spread.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::lens {

namespace {

constexpr double kLeastSlope = 0.05;
constexpr double kStraight = 1e-6;                 // below it sin x equals x
constexpr double kLeastKappa = -3.0, kMost = 2.0;  // beyond the curvature of any real lens
constexpr double kAngle = M_PI / 3.0, kStep = 1e-3;

/// Distance in pixels from the image of the axis, averaged over the azimuth. Empty beyond the field of view.
std::optional<double> radiusOf(const Lens& lens, double theta_rad) {
  constexpr int kBearings = 8;
  const auto axis = lens.pixelFromRay({0.0, 0.0, 1.0});
  double sum = 0.0;
  for (int k = 0; k < kBearings && axis; ++k) {
    const double phi = 2.0 * M_PI * k / kBearings, s = std::sin(theta_rad);
    const auto pixel = lens.pixelFromRay({s * std::cos(phi), s * std::sin(phi), std::cos(theta_rad)});
    if (!pixel) return std::nullopt;
    sum += (*pixel - *axis).norm();
  }
  return axis ? std::optional(sum / kBearings) : std::nullopt;
}

}  // namespace

Spread::Spread(double kappa) : kappa_(kappa), root_(std::sqrt(std::abs(kappa))) {}

double Spread::radius(double theta_rad) const {
  if (root_ * theta_rad < kStraight) return theta_rad;
  return (kappa_ > 0.0 ? std::sin(root_ * theta_rad) : std::sinh(root_ * theta_rad)) / root_;
}

double Spread::slope(double theta_rad) const {
  return std::max(kLeastSlope, kappa_ > 0.0 ? std::cos(root_ * theta_rad) : std::cosh(root_ * theta_rad));
}

Spread Spread::of(const Camera& camera) {
  const double edge = 0.5 * camera.model().fov_deg * M_PI / 180.0;
  const double theta =
      camera.model().kind == CameraKind::kPinhole ? 0.5 * kAngle : std::min(kAngle, 0.9 * edge);
  const auto before = radiusOf(camera.lens(), theta - kStep), after = radiusOf(camera.lens(), theta + kStep);
  if (!before || !after || !(*after > *before)) return Spread();
  const double wanted = 0.5 * (*before + *after) / (*after - *before) * 2.0 * kStep;  // r/r′
  double low = kLeastKappa, high = kMost;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    const Spread spread(middle);
    (spread.radius(theta) / spread.slope(theta) < wanted ? low : high) = middle;
  }
  return Spread(0.5 * (low + high));
}

}  // namespace omnifleet::lens
