#include "scan/step_check.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

namespace omnifleet::scan {
namespace {

constexpr std::size_t kLeastLines = 60;  // beams
constexpr double kMatched = 0.6;         // share of the lines that must meet lines of the scan before
constexpr double kMaxChi2 = 6.0;
constexpr double kSigmas2 = 9.0;                      // three σ, squared
constexpr double kFloor_m = 0.01, kFloor_rad = 0.01;  // σ; motions and clocks are no better
constexpr double kReach_m = 0.2, kReach_rad = 0.1;    // σ of a start for the match

Eigen::Matrix3d squares(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

}  // namespace

void StepCheck::remember(std::int64_t time_ns, const Boundary& boundary) {
  time_ns_ = time_ns;
  previous_ = boundary;
}

StepCheck::Verdict StepCheck::judge(std::int64_t since_ns, const Pose2& previous_from_current,
                                    const Eigen::Matrix3d& covariance, const Boundary& boundary) {
  if (since_ns != time_ns_ || previous_.inverse_m.empty() || boundary.inverse_m.empty())
    return Verdict::kNothing;
  before_.fit(previous_);
  now_.fit(boundary);
  if (std::min(before_.lines(), now_.lines()) < kLeastLines) return Verdict::kNothing;
  const Pose2 base_from_previous{previous_.origin_m.x(), previous_.origin_m.y(), 0.0},
      base_from_scan{boundary.origin_m.x(), boundary.origin_m.y(), 0.0};
  const Eigen::Matrix3d loose = covariance + squares(kFloor_m, kFloor_rad),
                        prior = (covariance + squares(kReach_m, kReach_rad)).inverse();
  const Pose2 start = previous_from_current * base_from_scan;
  const std::vector<Reference> references{{&before_, base_from_previous}};
  const Match match = matcher_.match(now_, start, prior, references);
  if (!match.valid || match.matched < kMatched || match.chi2 > kMaxChi2) return Verdict::kDiffers;
  const Eigen::Vector3d off = (start.inverse() * match.map_from_scan).vector();
  return off.dot(loose.ldlt().solve(off)) < kSigmas2 ? Verdict::kAgrees : Verdict::kDiffers;
}

}  // namespace omnifleet::scan
