#include "scan/edge_parallax.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <utility>

namespace omnifleet::scan {
namespace {

constexpr double kReach = 0.5;  // share of the motion by which edges may move otherwise: boards of H/3

Eigen::Matrix3d informationOf(double sigma_m, double sigma_rad) {
  const double m = 1.0 / (sigma_m * sigma_m), rad = 1.0 / (sigma_rad * sigma_rad);
  return Eigen::Vector3d(m, m, rad).asDiagonal();
}

}  // namespace

EdgeParallaxOptions EdgeParallaxOptions::read(const options::Section& section) {
  EdgeParallaxOptions o;
  section.read("baseline_m", o.baseline_m, options::kPositive);
  section.read("most_baseline_m", o.most_baseline_m, options::kPositive);
  section.read("motion_share", o.motion_share, options::kPositive);
  section.read("motion_radpm", o.motion_radpm, options::kPositive);
  section.read("step_m", o.step_m, options::kNotNegative);
  section.read("memory", o.memory, {1.0, 1e6});
  section.finish();
  return o;
}

void EdgeParallax::restart() {
  has_reference_ = false;
  information_ = weighted_ = 0.0;
  comparisons_ = 0;
}

double EdgeParallax::sigma() const {
  if (!(information_ > 0.0)) return std::numeric_limits<double>::infinity();
  return std::hypot(1.0 / std::sqrt(information_), options_.motion_share);
}

/// Adds what the present scan says against the reference. The match alone says how far the edges moved; its
/// start and a loose prior come from the motion. @return whether they match
bool EdgeParallax::compare(double moved_m) {
  const Pose2& start = reference_from_now_;
  const double turn_rad = options_.motion_radpm * moved_m;
  const Match match =
      matcher_.match(scan_, start, informationOf(kReach * moved_m, turn_rad), {{&reference_, Pose2{}}});
  if (!match.valid) return false;
  const Eigen::Vector3d to_match = (start.inverse() * match.map_from_scan).vector();
  const Eigen::Vector3d pull = match.information * to_match + match.gradient;
  // The error of the motion adds to that of the match: (Λ⁻¹ + Q)⁻¹ = K·Λ with K = I − Λ·(Λ + Q⁻¹)⁻¹.
  const Eigen::Matrix3d motion =
      informationOf(std::hypot(options_.motion_share * moved_m, options_.step_m), turn_rad);
  const Eigen::Matrix3d kept =
      Eigen::Matrix3d::Identity() - match.information * (match.information + motion).inverse();
  Eigen::Vector3d per_excess = Eigen::Vector3d::Zero();
  per_excess.head<2>() = start.rotation().transpose() * start.translation();
  const double share = 1.0 - 1.0 / options_.memory;
  information_ = share * information_ + per_excess.dot(kept * match.information * per_excess);
  weighted_ = share * weighted_ + per_excess.dot(kept * pull);
  ++comparisons_;
  return true;
}

void EdgeParallax::add(const Boundary& boundary, const std::vector<bool>& usable) {
  const double moved_m = reference_from_now_.translation().norm();
  if (has_reference_ && moved_m < options_.baseline_m) return;
  scan_.fit(boundary, usable);
  if (has_reference_ && !compare(moved_m) && moved_m < options_.most_baseline_m) return;
  std::swap(reference_, scan_);
  has_reference_ = true;
  reference_from_now_ = {};
}

}  // namespace omnifleet::scan
