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

struct Sample {
  Pose2 exact, estimate;
  Eigen::LLT<Eigen::Matrix3d> root;  ///< of the covariance
  std::uint32_t datum = 0;
};

std::vector<Sample> samplesOf(const ToldPath& path) {
  std::vector<Sample> samples;
  auto at = path.covariances.begin();
  for (const StampedPose& pose : path.estimate) {
    while (at != path.covariances.end() && at->time_ns < pose.time_ns) ++at;
    Sample sample;
    if (at == path.covariances.end() || at->time_ns != pose.time_ns) continue;
    if (!poseAt(path.truth, pose.time_ns, path.max_gap_ns, sample.exact)) continue;
    sample.estimate = pose.map_from_base;
    sample.root.compute(at->covariance);
    sample.datum = at->datum;
    if (sample.root.info() == Eigen::Success) samples.push_back(std::move(sample));
  }
  return samples;
}

/// In base_link as it is estimated.
Eigen::Vector3d errorOf(const Sample& sample, const Pose2& place) {
  return ((place * sample.estimate).inverse() * sample.exact).vector();
}

/// The motion that brings the positions onto the truth, then Gauss–Newton on the sum of ε.
Pose2 placeOf(const std::vector<Sample>& samples) {
  constexpr int kIterations = 10;
  std::vector<dataset::StampedPose3> from, to;
  for (const Sample& sample : samples) {
    from.push_back(lift(StampedPose{0, sample.estimate}));
    to.push_back(lift(StampedPose{0, sample.exact}));
  }
  const Similarity fit = align(from, to, Alignment::kSe2, false);
  Pose2 place{fit.translation.x(), fit.translation.y(), std::atan2(fit.rotation(1, 0), fit.rotation(0, 0))};
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const Sample& sample : samples) {
      const Pose2 moved = place * sample.estimate;
      const Eigen::Vector3d e = errorOf(sample, place);
      // e by a motion of everything about the truth's origin, from the left.
      const Eigen::Matrix2d base_from_map = moved.rotation().transpose();
      Eigen::Matrix3d by = Eigen::Matrix3d::Zero();
      by.topLeftCorner<2, 2>() = -base_from_map;
      by.col(2) << -base_from_map * Eigen::Vector2d(-moved.y_m, moved.x_m) + Eigen::Vector2d(e.y(), -e.x()),
          -1.0;
      const Eigen::Matrix3d whitened_by = sample.root.matrixL().solve(by);
      h += whitened_by.transpose() * whitened_by;
      g += whitened_by.transpose() * sample.root.matrixL().solve(e);
    }
    place = Pose2::fromVector(-h.ldlt().solve(g)) * place;
  }
  return place;
}

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

DatumPlaces placeData(const std::vector<ToldPath>& fleet) {
  std::map<std::uint32_t, std::vector<Sample>> by_datum;
  for (const ToldPath& path : fleet) {
    for (Sample& sample : samplesOf(path)) by_datum[sample.datum].push_back(std::move(sample));
  }
  DatumPlaces places;
  for (const auto& [datum, samples] : by_datum) places[datum] = placeOf(samples);
  return places;
}

Consistency checkConsistency(const ToldPath& path, const DatumPlaces& places) {
  Consistency c;
  std::vector<Eigen::Vector3d> whitened;
  for (const Sample& sample : samplesOf(path)) {
    const auto place = places.find(sample.datum);
    const Eigen::Vector3d e = errorOf(sample, place == places.end() ? Pose2{} : place->second);
    whitened.push_back(sample.root.matrixL().solve(e));
  }
  c.samples = static_cast<int>(whitened.size());
  if (whitened.empty()) {
    c.mean = c.position = c.inside = std::numeric_limits<double>::quiet_NaN();
    return c;
  }
  for (const Eigen::Vector3d& e : whitened) {
    c.mean += e.squaredNorm() / c.samples;
    c.position += e.head<2>().squaredNorm() / c.samples;  // of a lower root: as if nothing were said of θ
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
    all.position += robot.samples * robot.position;
    all.inside += robot.samples * robot.inside;
  }
  if (all.samples == 0) return checkConsistency({});
  all.mean /= all.samples;
  all.position /= all.samples;
  all.inside /= all.samples;
  setBounds(all);
  return all;
}

}  // namespace omnifleet::evaluation
