#include "laser/scan_match.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace omnifleet::laser {
namespace {

constexpr int kAside = 3;             // echoes on either side that define a line
constexpr double kCorrelation = 7.0;  // neighbouring echoes share their line
constexpr double kWindow_rad = 0.15;  // bearings searched for a correspondence
constexpr double kFlat = 0.1;         // largest relative step of the range along one surface
constexpr double kUneven_m = 0.003;   // m, roughness of surfaces, beside the noise of the echoes
constexpr double kWheels_m = 0.03, kWheelsRad = 0.06;  // m, rad, σ of the wheels' error within a step
constexpr double kLeast_m = 0.001, kLeastRad = 0.001;  // m, rad, lower bound of σ
constexpr int kIterations = 10, kFewest = 30;
constexpr double kCauchySigmas = 3.0;
constexpr double kFirst_m = 0.30,
                 kThen_m =
                     0.10;  // m, largest distance of a correspondence, in the first and in later iterations
constexpr int kFirstIterations = 4;

Pose2 right(const Pose2& pose, const Eigen::Vector3d& step) {
  return pose * Pose2{step.x(), step.y(), step.z()};
}

}  // namespace

void ScanMatcher::fitLines() {
  const std::size_t n = before_.size();
  lines_.assign(n, Line{});
  for (std::size_t i = 0; i < n; ++i) {
    if (!before_.closed && (i < kAside || i + kAside >= n)) continue;
    if (!before_.at(i).is_static) continue;
    Line line;
    bool one = true;
    for (int k = -kAside; k <= kAside && one; ++k) {
      const Beam& beam = before_.at(i + n - kAside + static_cast<std::size_t>(k + kAside));
      one = beam.echo == Echo::kHit &&
            std::abs(beam.range_m - before_.at(i).range_m) < kFlat * before_.at(i).range_m;
      line.at += beam.point_m / (2.0 * kAside + 1.0);
    }
    if (!one) continue;
    const Eigen::Vector2d along = before_.at(i + kAside).point_m - before_.at(i + n - kAside).point_m;
    if (along.norm() < 1e-6) continue;
    line.normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
    line.valid = true;
    lines_[i] = line;
  }
}

const ScanMatcher::Line* ScanMatcher::nearest(const Eigen::Vector2d& point_m, double within_m) const {
  const auto n = static_cast<long>(before_.size());
  double turn = std::atan2(point_m.y(), point_m.x()) - before_.beam.front().bearing_rad;
  turn -= 2.0 * M_PI * std::floor(turn / (2.0 * M_PI));
  const long middle = std::lround(turn / before_.spacing_rad);
  const long aside = std::lround(std::ceil(kWindow_rad / before_.spacing_rad));
  const Line* best = nullptr;
  double least = within_m * within_m;
  for (long i = middle - aside; i <= middle + aside; ++i) {
    if (!before_.closed && (i < 0 || i >= n)) continue;
    const auto k = static_cast<std::size_t>(((i % n) + n) % n);
    if (!lines_[k].valid) continue;
    const double squared = (before_.beam[k].point_m - point_m).squaredNorm();
    if (squared >= least) continue;
    least = squared;
    best = &lines_[k];
  }
  return best;
}

int ScanMatcher::gather(const Beams& scan, const Eigen::Vector2d& origin_m, double variance,
                        const Pose2& pose, double within_m, Normal& normal) const {
  const Eigen::Matrix2d axes = pose.rotation();
  int count = 0;
  for (const Beam& beam : scan.beam) {
    if (beam.echo != Echo::kHit) continue;
    const Eigen::Vector2d now = beam.point_m + origin_m, then = pose * now - origin_m;
    const Line* line = nearest(then, within_m);
    if (line == nullptr) continue;
    const Eigen::Vector2d n = axes.transpose() * line->normal;
    const Eigen::Vector3d row(n.x(), n.y(), n.dot(Eigen::Vector2d(-now.y(), now.x())));
    const double residual = line->normal.dot(line->at - then);
    const double misfit = residual * residual / (kCauchySigmas * kCauchySigmas * variance);
    const double weight = 1.0 / (variance * kCorrelation * (1.0 + misfit));
    normal.information += weight * row * row.transpose();
    normal.gradient += weight * residual * row;
    ++count;
  }
  return count;
}

Motion ScanMatcher::match(const Beams& scan, const Eigen::Vector2d& origin_m, double range_sigma_m,
                          const Motion& wheels) const {
  const double variance = range_sigma_m * range_sigma_m + kUneven_m * kUneven_m;
  const Eigen::Vector3d missed(kWheels_m * kWheels_m, kWheels_m * kWheels_m, kWheelsRad * kWheelsRad);
  const Eigen::Matrix3d prior = (wheels.covariance + Eigen::Matrix3d(missed.asDiagonal())).inverse();
  const Pose2 from_wheels = wheels.previous_from_current.inverse();
  Pose2 pose = wheels.previous_from_current;
  Normal normal;
  int count = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    normal = {prior, -prior * (from_wheels * pose).vector()};
    count = gather(scan, origin_m, variance, pose, iteration < kFirstIterations ? kFirst_m : kThen_m, normal);
    pose = right(pose, normal.information.ldlt().solve(normal.gradient));
  }
  if (count < kFewest || !pose.isFinite()) return wheels;
  const Eigen::Vector3d least(kLeast_m * kLeast_m, kLeast_m * kLeast_m, kLeastRad * kLeastRad);
  Motion motion = wheels;
  motion.previous_from_current = pose;
  motion.covariance = normal.information.inverse() + Eigen::Matrix3d(least.asDiagonal());
  return motion;
}

Motion ScanMatcher::refine(const Beams& scan, const Eigen::Vector2d& origin_m, double range_sigma_m,
                           const Motion& wheels) {
  Motion motion = wheels;
  if (wheels.valid && !before_.beam.empty()) {
    fitLines();
    motion = match(scan, origin_m, range_sigma_m, wheels);
  }
  before_ = scan;
  return motion;
}

}  // namespace omnifleet::laser
