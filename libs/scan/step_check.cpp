#include "scan/step_check.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

namespace omnifleet::scan {
namespace {

Eigen::Matrix3d squares(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

}  // namespace

StepCheckOptions StepCheckOptions::read(const options::Section& section) {
  using options::kPositive;
  StepCheckOptions o;
  section.read("min_lines", o.min_lines, {10, 1440});
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("max_chi2", o.max_chi2, kPositive);
  section.read("agrees_chi2", o.agrees_chi2, kPositive);
  section.read("floor_m", o.floor_m, kPositive);
  section.read("floor_rad", o.floor_rad, kPositive);
  section.read("reach_m", o.reach_m, kPositive);
  section.read("reach_rad", o.reach_rad, kPositive);
  section.finish();
  return o;
}

void StepCheck::remember(std::int64_t time_ns, const Boundary& boundary) {
  time_ns_ = time_ns;
  previous_ = boundary;
  before_fitted_ = false;
}

StepCheck::Verdict StepCheck::judge(std::int64_t since_ns, const Pose2& previous_from_current,
                                    const Eigen::Matrix3d& covariance, const Boundary& boundary) {
  if (since_ns != time_ns_ || previous_.inverse_m.empty() || boundary.inverse_m.empty())
    return Verdict::kNothing;
  if (!before_fitted_) before_.fit(previous_);
  before_fitted_ = true;
  now_.fit(boundary);
  if (std::min(before_.lines(), now_.lines()) < static_cast<std::size_t>(options_.min_lines))
    return Verdict::kNothing;
  const Pose2 base_from_previous{previous_.origin_m.x(), previous_.origin_m.y(), 0.0},
      base_from_scan{boundary.origin_m.x(), boundary.origin_m.y(), 0.0};
  const Eigen::Matrix3d loose = covariance + squares(options_.floor_m, options_.floor_rad),
                        prior = (covariance + squares(options_.reach_m, options_.reach_rad)).inverse();
  const Pose2 start = previous_from_current * base_from_scan;
  const std::vector<Reference> references{{&before_, base_from_previous}};
  const Match match = matcher_.match(now_, start, prior, references);
  if (!match.valid || match.matched < options_.min_matched || match.chi2 > options_.max_chi2)
    return Verdict::kDiffers;
  const Eigen::Vector3d off = (start.inverse() * match.map_from_scan).vector();
  return off.dot(loose.ldlt().solve(off)) < options_.agrees_chi2 ? Verdict::kAgrees : Verdict::kDiffers;
}

}  // namespace omnifleet::scan
