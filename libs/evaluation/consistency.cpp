#include "evaluation/consistency.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluation {
namespace {

constexpr double kInside = 7.815;  // χ² with 3 degrees of freedom, 95 %
constexpr double kNormal = 1.96;   // two-sided 95 %

double independentSamples(const std::vector<Eigen::Vector3d>& errors) {
  const std::size_t n = errors.size();
  double power = 0.0;
  for (const Eigen::Vector3d& e : errors) power += e.squaredNorm();
  if (!(power > 0.0)) return static_cast<double>(n);
  double worth = 1.0;
  for (std::size_t lag = 1; lag < n; ++lag) {
    double sum = 0.0;
    for (std::size_t i = lag; i < n; ++i) sum += errors[i].dot(errors[i - lag]);
    if (sum <= 0.0) break;
    worth += 2.0 * sum / power * sum / power;
  }
  return std::max(1.0, static_cast<double>(n) / worth);
}

Consistency::Bounds boundsOf(double samples) {
  const double freedom = 3.0 * samples;
  return {chiSquareQuantile(freedom, -kNormal) / samples, chiSquareQuantile(freedom, kNormal) / samples};
}

void setBounds(Consistency& c) {
  c.strict = boundsOf(c.samples);
  c.bounds = boundsOf(c.independent);
}

}  // namespace

double chiSquareQuantile(double degrees_of_freedom, double z) {
  const double part = 2.0 / (9.0 * degrees_of_freedom);
  const double root = std::max(0.0, 1.0 - part + z * std::sqrt(part));
  return degrees_of_freedom * root * root * root;
}

Consistency checkConsistency(const std::vector<StampedPose>& truth, const std::vector<StampedPose>& estimate,
                             const std::vector<dataset::StampedCovariance>& covariances, TimeNs max_gap_ns) {
  Consistency c;
  std::vector<Eigen::Vector3d> whitened;
  auto at = covariances.begin();
  for (const StampedPose& pose : estimate) {
    while (at != covariances.end() && at->time_ns < pose.time_ns) ++at;
    Pose2 exact;
    if (at == covariances.end() || at->time_ns != pose.time_ns) continue;
    if (!poseAt(truth, pose.time_ns, max_gap_ns, exact)) continue;
    const Eigen::LLT<Eigen::Matrix3d> root(at->covariance);
    if (root.info() != Eigen::Success) continue;
    whitened.push_back(root.matrixL().solve((pose.map_from_base.inverse() * exact).vector()));
  }
  c.samples = static_cast<int>(whitened.size());
  if (whitened.empty()) {
    c.mean = c.inside = std::numeric_limits<double>::quiet_NaN();
    return c;
  }
  for (const Eigen::Vector3d& e : whitened) {
    c.mean += e.squaredNorm() / c.samples;
    c.inside += (e.squaredNorm() <= kInside ? 1.0 : 0.0) / c.samples;
  }
  c.independent = independentSamples(whitened);
  setBounds(c);
  return c;
}

Consistency pooled(const std::vector<Consistency>& robots) {
  Consistency all;
  for (const Consistency& robot : robots) {
    if (robot.samples == 0) continue;
    all.samples += robot.samples;
    all.independent += robot.independent;
    all.mean += robot.samples * robot.mean;
    all.inside += robot.samples * robot.inside;
  }
  if (all.samples == 0) return checkConsistency({}, {}, {});
  all.mean /= all.samples;
  all.inside /= all.samples;
  setBounds(all);
  return all;
}

}  // namespace omnifleet::evaluation
