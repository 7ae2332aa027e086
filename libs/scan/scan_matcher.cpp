#include "scan/scan_matcher.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace omnifleet::scan {
namespace {

constexpr int kFirstReach = 8, kReach = 4, kFirstRounds = 3;  // beams to both sides of the predicted one
constexpr double kLeastDepth = 0.05;    // of a line before the scan's origin, as a share of its distance
constexpr double kLeastInverse = 0.02;  // 1/m
constexpr double kPointSigmas = 3.0;
constexpr double kConverged = 2e-5;  // m, rad

}  // namespace

/// Normal equations of one iteration.
struct ScanMatcher::Sums {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  double chi2 = 0.0, weight = 0.0;
  int pairs = 0, beams = 0;
};

MatchOptions MatchOptions::read(const options::Section& section) {
  MatchOptions o;
  section.read("gate_m", o.gate_m, {0.001, 10.0});
  section.read("first_gate_sigmas", o.first_gate_sigmas, {1.0, 1000.0});
  section.read("last_gate_sigmas", o.last_gate_sigmas, {1.0, 1000.0});
  section.read("robust_sigmas", o.robust_sigmas, {0.1, 100.0});
  section.read("min_cosine", o.min_cosine, {0.0, 1.0});
  section.read("iterations", o.iterations, {1, 100});
  section.read("stride", o.stride, {1, 16});
  section.read("min_beams", o.min_beams, {3, 1000});
  section.finish();
  return o;
}

void ScanMatcher::addReference(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                               double gate, Sums& sums) {
  const Pose2 relative = reference.map_from_scan.inverse() * pose;
  const Eigen::Matrix2d rotation = relative.rotation();
  const Eigen::Vector2d shift = relative.translation();
  const Eigen::Matrix2d turning =  // derivative of the transposed rotation by the angle
      (Eigen::Matrix2d() << -rotation(1, 0), rotation(0, 0), -rotation(0, 0), -rotation(1, 0)).finished();
  const auto& beams = scan.beams();
  const auto& others = reference.scan->beams();
  const int m = static_cast<int>(others.size());
  const double per_radian = m / (2.0 * M_PI);
  for (std::size_t j = 0; j < beams.size(); j += static_cast<std::size_t>(options_.stride)) {
    const LineScan::Beam& beam = beams[j];
    if (!beam.has_line) continue;
    const Eigen::Vector2d point = beam.point_m.cast<double>(), there = relative * point;
    const int centre = static_cast<int>(std::lround(std::atan2(there.y(), there.x()) * per_radian));
    const LineScan::Beam* nearest = nullptr;
    double nearest2 = 0.0;
    for (int d = -reach; d <= reach; ++d) {
      const LineScan::Beam& other = others[static_cast<std::size_t>((centre + d + 2 * m) % m)];
      if (!other.has_line) continue;
      const double distance2 = (other.point_m.cast<double>() - there).squaredNorm();
      if (nearest == nullptr || distance2 < nearest2) nearest = &other, nearest2 = distance2;
    }
    if (nearest == nullptr) continue;
    const double range_m = point.norm(), sigma_m = static_cast<double>(beam.sigma) * range_m * range_m;
    const double reach_m = options_.gate_m + kPointSigmas * sigma_m;
    if (nearest2 > reach_m * reach_m) continue;
    // The reference's line a·p = 1, seen from the scan: (Rᵀa / (1 − a·t))·p = 1.
    const Eigen::Vector2d a = nearest->line.cast<double>();
    const double depth = 1.0 - a.dot(shift);
    if (depth < kLeastDepth) continue;
    const Eigen::Vector2d line = rotation.transpose() * a / depth, own = beam.line.cast<double>();
    if (own.dot(line) < options_.min_cosine * own.norm() * line.norm()) continue;
    const Eigen::Vector2d u = scan.bearings()[j].cast<double>();
    const double predicted = line.dot(u);
    if (predicted < kLeastInverse) continue;
    const Eigen::Vector2d by_line = (rotation * u + predicted * shift) / depth;
    const double variance = static_cast<double>(beam.sigma) * beam.sigma +
                            by_line.dot(nearest->line_covariance.cast<double>() * by_line);
    const double residual = static_cast<double>(beam.s) - predicted, z2 = residual * residual / variance;
    if (z2 > gate * gate) continue;
    const double weight = 1.0 / (1.0 + z2 / (options_.robust_sigmas * options_.robust_sigmas));
    const Eigen::Vector2d by_shift = predicted / depth * (rotation.transpose() * a);
    const Eigen::Vector3d jacobian(by_shift.x(), by_shift.y(), (turning * a).dot(u) / depth);
    sums.h += weight / variance * jacobian * jacobian.transpose();
    sums.g += weight / variance * residual * jacobian;
    sums.chi2 += weight * z2;
    sums.weight += weight;
    ++sums.pairs;
    sums.beams += hit_[j] == 0 ? 1 : 0;
    hit_[j] = 1;
  }
}

Match ScanMatcher::match(const LineScan& scan, const Pose2& start, const Eigen::Matrix3d& prior,
                         const std::vector<Reference>& references) {
  Match match;
  match.map_from_scan = start;
  if (references.empty()) return match;
  int possible = 0;
  for (std::size_t j = 0; j < scan.beams().size(); j += static_cast<std::size_t>(options_.stride))
    possible += scan.beams()[j].has_line ? 1 : 0;
  Pose2 pose = start;
  for (int round = 0; round < options_.iterations; ++round) {
    // Gates shrink geometrically and reach their last value after three quarters of the iterations.
    const double share = std::min(1.0, round / std::max(1.0, 0.75 * (options_.iterations - 1)));
    const double gate =
        options_.first_gate_sigmas * std::pow(options_.last_gate_sigmas / options_.first_gate_sigmas, share);
    hit_.assign(scan.beams().size(), 0);
    Sums sums;
    for (const Reference& reference : references)
      addReference(scan, reference, pose, round < kFirstRounds ? kFirstReach : kReach, gate, sums);
    if (sums.beams < options_.min_beams) return match;
    const double per_reference = 1.0 / static_cast<double>(references.size());
    sums.h *= per_reference;
    sums.g *= per_reference;
    const Pose2 off = pose.inverse() * start;
    const Eigen::Vector3d to_start(off.x_m, off.y_m, wrapAngle(off.theta_rad));
    const Eigen::Vector3d step = (sums.h + prior).ldlt().solve(sums.g + prior * to_start);
    if (!step.allFinite()) return match;
    pose = pose * Pose2{step.x(), step.y(), step.z()};
    match.information = sums.h;
    match.gradient = sums.g - sums.h * step;
    match.chi2 = sums.chi2 / std::max(1e-9, sums.weight);
    match.matched = static_cast<double>(sums.beams) / std::max(1, possible);
    match.beams = sums.beams;
    if (share >= 1.0 && step.cwiseAbs().maxCoeff() < kConverged) break;
  }
  match.valid = true;
  match.map_from_scan = pose;
  return match;
}

}  // namespace omnifleet::scan
