#include "markers/rectangle_fit.h"

#include <Eigen/Dense>
#include <array>
#include <cmath>

namespace omnifleet::markers {
namespace {

constexpr int kIterations = 5;
constexpr double kSettled =
    1e-5;  // metres and radians: below this step the iteration ends; the next step is far below 1 µm
constexpr double kBlur_px = 0.45;       // σ of the camera's point spread, including the width of a pixel
constexpr double kCoverageSigma = 0.1;  // σ of the coverage of one pixel: colour noise and compression

/// Standard normal distribution and density from a table, accurate to 1e-8.
class NormalTable {
 public:
  NormalTable() {
    for (int i = 0; i <= kNodes; ++i) {
      const double t = static_cast<double>(i) / kPerUnit - kReach;
      nodes_[static_cast<std::size_t>(i)] = {0.5 + 0.5 * std::erf(t * M_SQRT1_2),
                                             std::exp(-0.5 * t * t) / std::sqrt(2.0 * M_PI)};
    }
  }
  static constexpr int kReach = 6;  ///< beyond it the distribution is 0 or 1
  struct Value {
    double distribution, density;
  };
  Value at(double t) const {
    if (!(t > -kReach)) return {0.0, 0.0};
    if (t >= kReach) return {1.0, 0.0};
    const int i = static_cast<int>((t + kReach) * kPerUnit + 0.5);
    const double node = static_cast<double>(i) / kPerUnit - kReach, d = t - node;
    const Value& v = nodes_[static_cast<std::size_t>(i)];
    // Taylor expansion: the derivatives of the density are the density times Hermite polynomials.
    const double h2 = node * node - 1.0, h3 = node * (node * node - 3.0);
    return {v.distribution + v.density * d * (1.0 - d * (node / 2.0 - d * h2 / 6.0)),
            v.density * (1.0 - d * (node - d * (h2 / 2.0 - d * h3 / 6.0)))};
  }

 private:
  static constexpr int kPerUnit = 32, kNodes = 2 * kReach * kPerUnit;
  std::array<Value, kNodes + 1> nodes_{};
};

/// Value at u of an interval [−half, half] blurred by a Gaussian, and its derivative. `sharpness` is 1/σ of
/// the blur.
struct Box {
  double value, slope;
};
Box box(const NormalTable& normal, double u, double half, double sharpness) {
  const auto a = normal.at((u + half) * sharpness), b = normal.at((u - half) * sharpness);
  return {a.distribution - b.distribution, (a.density - b.density) * sharpness};
}

}  // namespace

RectangleFit::RectangleFit(const dataset::MarkerSet& markers, const FinderOptions& options)
    : team_m_(markers.team_offset_m),
      individual_m_(markers.individual_offset_m),
      half_m_(0.5 * markers.patch_size_m),
      options_(options) {}

void RectangleFit::accumulate(const Patch& patch, const Eigen::Vector2d& offset_m, const Pose2& map_from_base,
                              double blur_m, Normal& normal) const {
  static const NormalTable kNormal;
  const Eigen::Matrix2d turn = map_from_base.rotation().transpose();
  const Eigen::Vector2d from = map_from_base.translation();
  const double sharpness = 1.0 / blur_m;
  const Eigen::Vector2d well_inside = half_m_.array() - NormalTable::kReach * blur_m;
  for (const Sample& sample : patch.samples) {
    const Eigen::Vector2d in_base = turn * (sample.place_m - from), in_patch = in_base - offset_m;
    ++normal.count;
    if (std::abs(in_patch.x()) < well_inside.x() && std::abs(in_patch.y()) < well_inside.y()) {
      normal.squares += (sample.coverage - 1.0) * (sample.coverage - 1.0);
      continue;
    }
    const Box x = box(kNormal, in_patch.x(), half_m_.x(), sharpness),
              y = box(kNormal, in_patch.y(), half_m_.y(), sharpness);
    const double residual = sample.coverage - x.value * y.value;
    normal.squares += residual * residual;
    const Eigen::Vector2d gradient(x.slope * y.value, x.value * y.slope);
    if (gradient.isZero(0.0)) continue;  // well outside the patch
    // A right perturbation (dx, dy, dθ) of the pose moves the sample by the opposite amount in base_link.
    const Eigen::Vector3d jacobian(-gradient.x(), -gradient.y(),
                                   gradient.x() * in_base.y() - gradient.y() * in_base.x());
    normal.h += jacobian * jacobian.transpose();
    normal.g += jacobian * residual;
  }
}

bool RectangleFit::refine(const Patch& team, const Patch& individual, Detection& detection) const {
  const double metres_per_px = 0.5 * (team.metres_per_px + individual.metres_per_px);
  const bool cut = team.cut || individual.cut;
  Pose2 pose = detection.map_from_base;
  Normal normal;
  // The initial pose of a cut patch has a large error, so the fit starts with a coarse blur.
  for (double blur_px = cut ? 8.0 * kBlur_px : kBlur_px; blur_px >= kBlur_px; blur_px *= 0.5) {
    for (int i = 0; i < kIterations; ++i) {
      normal = Normal();
      accumulate(team, team_m_, pose, blur_px * metres_per_px, normal);
      accumulate(individual, individual_m_, pose, blur_px * metres_per_px, normal);
      if (!(normal.h.determinant() > 0)) return false;
      const Eigen::Vector3d step = normal.h.ldlt().solve(normal.g);
      pose = pose * Pose2{step.x(), step.y(), step.z()};
      if (step.cwiseAbs().maxCoeff() < kSettled) break;
    }
  }
  const Pose2 change = detection.map_from_base.inverse() * pose;
  const double reach = cut ? half_m_.norm() : 1.5 * metres_per_px;
  const double turn = cut ? 0.6 : 0.15;
  if (!pose.isFinite() || change.translation().norm() > reach || std::abs(change.theta_rad) > turn)
    return false;
  if (normal.squares > options_.max_fit_rms * options_.max_fit_rms * static_cast<double>(normal.count))
    return false;
  detection.map_from_base = pose;
  // Errors of neighbouring pixels are correlated and the lens model is not exact. So pixel_sigma_px is a
  // lower bound for the σ of the position.
  const double floor = std::pow(options_.pixel_sigma_px * metres_per_px, 2) * 0.5;
  detection.covariance = kCoverageSigma * kCoverageSigma * normal.h.inverse();
  detection.covariance.diagonal() +=
      Eigen::Vector3d(floor, floor, 4.0 * floor / (individual_m_ - team_m_).squaredNorm());
  return true;
}

}  // namespace omnifleet::markers
