#include "scan/scan_matcher.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace omnifleet::scan {
namespace {

constexpr int kFirstReach = 8, kReach = 4, kFirstRounds = 3;  // beams to both sides of the predicted one
constexpr double kLeastDepth = 0.05;    // of a line before the scan's origin, as a share of its distance
constexpr double kLeastInverse = 0.02;  // 1/m
constexpr double kPointSigmas = 3.0;
constexpr double kLoose = 1.0;  // 1/m², 1/rad²: information where a match leaves a direction open
constexpr std::size_t kSectors = 48;
constexpr double kFewSectors = 10.0;  // 1, times the scatter of few sectors, at most
constexpr int kPoseParameters = 3;
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

/// A beam and the line of a reference that it meets.
struct Pair {
  std::size_t beam, other;  ///< indices
  Eigen::Vector2d line;     ///< of the reference, seen from the scan
  double residual, variance, weight;
  Eigen::Vector3d jacobian;  ///< of the predicted inverse range by the pose, right perturbation
  double z2() const { return residual * residual / variance; }
};

/// Of a scan that shows little all beams are used.
std::size_t ScanMatcher::stride(const LineScan& scan) const {
  constexpr std::size_t kEnough = 4;  // times min_beams
  const auto least = kEnough * static_cast<std::size_t>(options_.min_beams);
  return std::clamp(scan.lines() / least, std::size_t{1}, static_cast<std::size_t>(options_.stride));
}

template <typename Visit>
void ScanMatcher::forEachPair(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                              double gate, const std::vector<std::uint8_t>& skip, Visit visit) const {
  const Pose2 relative = reference.map_from_scan.inverse() * pose;
  const Eigen::Matrix2d rotation = relative.rotation();
  const Eigen::Vector2d shift = relative.translation();
  const Eigen::Matrix2d turning =  // derivative of the transposed rotation by the angle
      (Eigen::Matrix2d() << -rotation(1, 0), rotation(0, 0), -rotation(0, 0), -rotation(1, 0)).finished();
  const auto& beams = scan.beams();
  const auto& others = reference.scan->beams();
  const int m = static_cast<int>(others.size());
  if (m == 0) return;
  const double per_radian = m / (2.0 * M_PI);
  for (std::size_t j = 0, step = stride(scan); j < beams.size(); j += step) {
    const LineScan::Beam& beam = beams[j];
    if (!beam.has_line || (!skip.empty() && skip[j] != 0)) continue;
    const Eigen::Vector2d point = beam.point_m.cast<double>(), there = relative * point;
    const int centre = static_cast<int>(std::lround(std::atan2(there.y(), there.x()) * per_radian));
    std::size_t nearest = others.size();
    double nearest2 = 0.0;
    for (int d = -reach; d <= reach; ++d) {
      const auto k = static_cast<std::size_t>((centre + d + 2 * m) % m);
      if (!others[k].has_line) continue;
      const double distance2 = (others[k].point_m.cast<double>() - there).squaredNorm();
      if (nearest == others.size() || distance2 < nearest2) nearest = k, nearest2 = distance2;
    }
    if (nearest == others.size()) continue;
    const double range_m = point.norm(), sigma_m = static_cast<double>(beam.sigma) * range_m * range_m;
    const double reach_m = options_.gate_m + kPointSigmas * sigma_m;
    if (nearest2 > reach_m * reach_m) continue;
    // The reference's line a·p = 1, seen from the scan: (Rᵀa / (1 − a·t))·p = 1.
    const LineScan::Beam& other = others[nearest];
    const Eigen::Vector2d a = other.line.cast<double>();
    const double depth = 1.0 - a.dot(shift);
    if (depth < kLeastDepth) continue;
    Pair pair;
    pair.beam = j;
    pair.other = nearest;
    pair.line = rotation.transpose() * a / depth;
    const Eigen::Vector2d own = beam.line.cast<double>();
    if (own.dot(pair.line) < options_.min_cosine * own.norm() * pair.line.norm()) continue;
    const Eigen::Vector2d u = scan.bearings()[j].cast<double>();
    const double predicted = pair.line.dot(u);
    if (predicted < kLeastInverse) continue;
    const Eigen::Vector2d by_line = (rotation * u + predicted * shift) / depth;
    pair.variance = static_cast<double>(beam.sigma) * beam.sigma +
                    by_line.dot(other.line_covariance.cast<double>() * by_line);
    pair.residual = static_cast<double>(beam.s) - predicted;
    if (pair.z2() > gate * gate) continue;
    pair.weight = 1.0 / (1.0 + pair.z2() / (options_.robust_sigmas * options_.robust_sigmas));
    const Eigen::Vector2d by_shift = predicted / depth * (rotation.transpose() * a);
    pair.jacobian = {by_shift.x(), by_shift.y(), (turning * a).dot(u) / depth};
    visit(pair);
  }
}

void ScanMatcher::addReference(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                               double gate, const std::vector<std::uint8_t>& skip, Sums& sums) {
  forEachPair(scan, reference, pose, reach, gate, skip, [&](const Pair& pair) {
    const Eigen::Matrix3d h = pair.weight / pair.variance * pair.jacobian * pair.jacobian.transpose();
    const Eigen::Vector3d g = pair.weight / pair.variance * pair.residual * pair.jacobian;
    Sector& sector = sectors_[pair.beam * sectors_.size() / scan.beams().size()];
    sums.h += h;
    sums.g += g;
    sector.h += h;
    sector.g += g;
    // Of the gradient by the residual, in units of the weighted square: Cauchy's ψ′ over ψ/z.
    sector.derivative +=
        pair.weight * (1.0 - pair.z2() / (options_.robust_sigmas * options_.robust_sigmas)) * h;
    sums.chi2 += pair.weight * pair.z2();
    sums.weight += pair.weight;
    ++sums.pairs;
    sums.beams += hit_[pair.beam] == 0 ? 1 : 0;
    hit_[pair.beam] = 1;
  });
}

CalibrationTerms ScanMatcher::calibrationTerms(const LineScan& scan, const Pose2& map_from_scan,
                                               const Reference& reference, const BeamFields& of_scan,
                                               const BeamFields& of_reference) const {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 8> cross = Eigen::Matrix<double, 3, 8>::Zero();
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> moment = Eigen::Matrix<double, 8, 1>::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  const Eigen::Matrix2d scan_from_reference = (map_from_scan.inverse() * reference.map_from_scan).rotation();
  const std::vector<std::uint8_t> none;
  forEachPair(scan, reference, map_from_scan, kReach, options_.last_gate_sigmas, none, [&](const Pair& pair) {
    // A point that is measured beside its place by Δ changes s by −s·(line·Δ).
    const double s = static_cast<double>(scan.beams()[pair.beam].s);
    Eigen::Matrix<double, 1, 8> by_error = Eigen::Matrix<double, 1, 8>::Zero();
    if (!of_scan.empty()) by_error.head<4>() = -s * pair.line.transpose() * of_scan[pair.beam].cast<double>();
    if (!of_reference.empty())
      by_error.tail<4>() =
          s * pair.line.transpose() * scan_from_reference * of_reference[pair.other].cast<double>();
    const double weight = pair.weight / pair.variance;
    h += weight * pair.jacobian * pair.jacobian.transpose();
    g += weight * pair.residual * pair.jacobian;
    cross += weight * pair.jacobian * by_error;
    information += weight * by_error.transpose() * by_error;
    moment += weight * pair.residual * by_error.transpose();
  });
  // residual(x + dx, e) = residual − jacobian·dx + by_error·(error that is taken for zero)
  CalibrationTerms terms;
  h.diagonal().array() += kLoose;
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(h);
  terms.pose_by_error = ldlt.solve(cross);
  terms.information = information - cross.transpose() * terms.pose_by_error;
  terms.gradient = moment - cross.transpose() * ldlt.solve(g);
  return terms;
}

/// Variance of the pose by the sectors' gradients, over that by the information, for each principal direction
/// of the information (cluster-robust covariance of an M-estimator; Liang, Zeger 1986). The directions
/// differ: along a corridor few beams carry information, so a few wrong pairs decide. The gradients are
/// weighed by the true derivative of the robust cost, and adjacent sectors go together (Newey, West 1987, lag
/// 1). Far from the optimum, where the prior holds the pose, the robust cost is not convex: there the
/// information stands for the derivative. The sectors hold sums over all references; per_reference makes
/// their mean of them.
ScanMatcher::Scatter ScanMatcher::scatter(double per_reference) const {
  constexpr double kAdjacent = 0.5;         // weight of lag 1
  constexpr double kLeastDerivative = 0.5;  // 1, of the information; normal noise has 0.8
  Eigen::Matrix3d total = Eigen::Matrix3d::Zero(), derivative = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  int filled = 0;
  for (const Sector& sector : sectors_) {
    total += sector.h;
    derivative += sector.derivative;
    g += sector.g;
    filled += sector.h.isZero() ? 0 : 1;
  }
  Scatter scatter;
  if (filled <= kPoseParameters) return scatter;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(total);
  const Eigen::Matrix3d axes = solver.eigenvectors();
  const Eigen::Vector3d roots = solver.eigenvalues();
  const auto determined = [&](Eigen::Index i) { return roots(i) > kLoose; };
  int directions = 0;
  bool convex = true;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (!determined(i)) continue;
    ++directions;
    convex = convex && axes.col(i).dot(derivative * axes.col(i)) > kLeastDerivative * roots(i);
  }
  if (directions == 0) return scatter;
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (!determined(i)) continue;
    const double slope = convex ? axes.col(i).dot(derivative * axes.col(i)) : roots(i);
    inverse += axes.col(i) * axes.col(i).transpose() / slope;
  }
  const Eigen::Vector3d optimum = inverse * g;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  const auto left = [&](std::size_t k) -> Eigen::Vector3d {
    const Sector& sector = sectors_[k % sectors_.size()];
    return sector.g - (convex ? sector.derivative : sector.h) * optimum;
  };
  for (std::size_t k = 0; k < sectors_.size(); ++k) {
    const Eigen::Vector3d own = left(k), next = left(k + 1);
    spread += own * own.transpose() + kAdjacent * (own * next.transpose() + next * own.transpose());
  }
  const Eigen::Matrix3d covariance = inverse * spread * inverse;
  const double unbiased = per_reference * static_cast<double>(filled) / (filled - kPoseParameters);
  scatter.mean = std::max(1.0, unbiased * (covariance * total).trace() / directions);
  scatter.weight.setZero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = axes.col(i);
    double along = scatter.mean;
    if (determined(i)) {
      // A variance estimated from few sectors is uncertain itself: Student's t, by the number of sectors that
      // hold the information.
      double squares = 0.0;
      for (const Sector& sector : sectors_) squares += std::pow(axis.dot(sector.h * axis), 2);
      const double sectors = roots(i) * roots(i) / squares,
                   few = std::min(kFewSectors, sectors / std::max(1e-9, sectors - kPoseParameters));
      along = few * per_reference * axis.dot(covariance * axis) * roots(i);
    }
    scatter.weight += axis * axis.transpose() / std::max(1.0, along);
  }
  return scatter;
}

Match ScanMatcher::match(const LineScan& scan, const Pose2& start, const Eigen::Matrix3d& prior,
                         const std::vector<Reference>& references, const std::vector<std::uint8_t>& skip) {
  Match match;
  match.map_from_scan = start;
  if (references.empty()) return match;
  int possible = 0;
  for (std::size_t j = 0, step = stride(scan); j < scan.beams().size(); j += step)
    possible += scan.beams()[j].has_line && (skip.empty() || skip[j] == 0) ? 1 : 0;
  Pose2 pose = start;
  for (int round = 0; round < options_.iterations; ++round) {
    // Gates shrink geometrically and reach their last value after three quarters of the iterations.
    const double share = std::min(1.0, round / std::max(1.0, 0.75 * (options_.iterations - 1)));
    const double gate =
        options_.first_gate_sigmas * std::pow(options_.last_gate_sigmas / options_.first_gate_sigmas, share);
    hit_.assign(scan.beams().size(), 0);
    sectors_.assign(kSectors, Sector{});
    Sums sums;
    for (const Reference& reference : references)
      addReference(scan, reference, pose, round < kFirstRounds ? kFirstReach : kReach, gate, skip, sums);
    if (sums.beams < options_.min_beams) return match;
    const double per_reference = 1.0 / static_cast<double>(references.size());
    sums.h *= per_reference;
    sums.g *= per_reference;
    const Pose2 off = pose.inverse() * start;
    const Eigen::Vector3d to_start(off.x_m, off.y_m, wrapAngle(off.theta_rad));
    const Scatter scattered = scatter(per_reference);
    // Beside the prior a direction counts as much as it is known, once the pairs have settled.
    const Eigen::Matrix3d weight = share < 1.0 ? Eigen::Matrix3d::Identity() : scattered.weight;
    const Eigen::Vector3d step = (weight * sums.h + prior).ldlt().solve(weight * sums.g + prior * to_start);
    if (!step.allFinite()) return match;
    pose = pose * Pose2{step.x(), step.y(), step.z()};
    match.scatter = scattered.mean;
    match.information = scattered.weight * sums.h;
    match.gradient = scattered.weight * (sums.g - sums.h * step);
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
