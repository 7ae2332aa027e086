#include "markers/rectangle_fit.h"

#include <Eigen/Dense>
#include <cmath>

namespace omnifleet::markers {
namespace {

constexpr int kIterations = 5;
constexpr double kBlur_px = 0.45;       // σ of a camera's point spread with the pixel's own width
constexpr double kCoverageSigma = 0.1;  // of one pixel's coverage: colour noise and compression

/// Part of a blurred interval [−half, half] at u, and its derivative.
struct Box {
  double value, slope;
};
Box box(double u, double half, double blur) {
  const double a = (u + half) / blur, b = (u - half) / blur;
  return {0.5 * (std::erf(a * M_SQRT1_2) - std::erf(b * M_SQRT1_2)),
          (std::exp(-0.5 * a * a) - std::exp(-0.5 * b * b)) / (blur * std::sqrt(2.0 * M_PI))};
}

}  // namespace

RectangleFit::RectangleFit(const dataset::MarkerSet& markers, double pixel_sigma_px)
    : team_m_(markers.team_offset_m),
      individual_m_(markers.individual_offset_m),
      half_m_(0.5 * markers.patch_size_m),
      pixel_sigma_px_(pixel_sigma_px) {}

void RectangleFit::accumulate(const Patch& patch, const Eigen::Vector2d& offset_m, const Pose2& map_from_base,
                              double blur_m, Normal& normal) const {
  const Pose2 base_from_map = map_from_base.inverse();
  for (const Sample& sample : patch.samples) {
    const Eigen::Vector2d in_base = base_from_map * sample.place_m, in_patch = in_base - offset_m;
    const Box x = box(in_patch.x(), half_m_.x(), blur_m), y = box(in_patch.y(), half_m_.y(), blur_m);
    const Eigen::Vector2d gradient(x.slope * y.value, x.value * y.slope);
    // A right perturbation (dx, dy, dθ) of the pose moves the sample by the opposite in base_link.
    const Eigen::Vector3d jacobian(-gradient.x(), -gradient.y(),
                                   gradient.x() * in_base.y() - gradient.y() * in_base.x());
    normal.h += jacobian * jacobian.transpose();
    normal.g += jacobian * (sample.coverage - x.value * y.value);
  }
}

void RectangleFit::refine(const Patch& team, const Patch& individual, Detection& detection) const {
  const double metres_per_px = 0.5 * (team.metres_per_px + individual.metres_per_px);
  Pose2 pose = detection.map_from_base;
  Normal normal;
  for (int i = 0; i < kIterations; ++i) {
    normal = Normal();
    accumulate(team, team_m_, pose, kBlur_px * metres_per_px, normal);
    accumulate(individual, individual_m_, pose, kBlur_px * metres_per_px, normal);
    if (normal.h.determinant() <= 0) return;
    const Eigen::Vector3d step = normal.h.ldlt().solve(normal.g);
    pose = pose * Pose2{step.x(), step.y(), step.z()};
  }
  const Pose2 change = detection.map_from_base.inverse() * pose;
  if (!pose.isFinite() || change.translation().norm() > metres_per_px || std::abs(change.theta_rad) > 0.1)
    return;
  detection.map_from_base = pose;
  // Pixels are not independent and lenses not perfect: a floor of pixel_sigma_px on the position.
  const double floor = std::pow(pixel_sigma_px_ * metres_per_px, 2) * 0.5;
  detection.covariance = kCoverageSigma * kCoverageSigma * normal.h.inverse();
  detection.covariance.diagonal() +=
      Eigen::Vector3d(floor, floor, 4.0 * floor / (individual_m_ - team_m_).squaredNorm());
}

}  // namespace omnifleet::markers
