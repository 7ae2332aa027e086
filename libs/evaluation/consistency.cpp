#include "evaluation/consistency.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluation/trajectory_metrics.h"
#include "geometry/twist.h"

namespace omnifleet::evaluation {
namespace {

constexpr double kInside = 7.815;  // χ² with 3 degrees of freedom, 95 %
constexpr double kNormal = 1.96;   // two-sided 95 %

struct Sample {
  TimeNs time_ns = 0;
  Pose2 exact, estimate;
  Eigen::LLT<Eigen::Matrix3d> root;  ///< Cholesky factor of the covariance
  std::uint32_t datum = 0;
};

std::vector<Sample> samplesOf(const EstimatedPath& path) {
  std::vector<Sample> samples;
  auto at = path.covariances.begin();
  for (const StampedPose& pose : path.estimate) {
    while (at != path.covariances.end() && at->time_ns < pose.time_ns) ++at;
    Sample sample;
    if (at == path.covariances.end() || at->time_ns != pose.time_ns) continue;
    if (!poseAt(path.truth, pose.time_ns, path.max_gap_ns, sample.exact)) continue;
    sample.time_ns = pose.time_ns;
    sample.estimate = pose.map_from_base;
    sample.root.compute(at->covariance);
    sample.datum = at->datum;
    if (sample.root.info() == Eigen::Success) samples.push_back(std::move(sample));
  }
  return samples;
}

Eigen::Vector3d errorOf(const Sample& sample, const Pose2& place) {
  return evaluation::errorOf(place * sample.estimate, sample.exact);
}

/// The rigid motion that aligns the positions with the truth, then refined by Gauss–Newton on the sum of ε.
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
      // Derivative of e by a left motion of the whole run about the origin of the truth.
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

/// Whitened errors of a robot in map axes. An error that is constant in map is a bias, even if the robot
/// turns.
struct Whitened {
  std::vector<TimeNs> times;
  std::vector<Eigen::Vector3d> errors;
  std::vector<double>
      positions;  ///< ε of x and y alone, as differences of coordinates, independent of the heading

  Eigen::Array3d power() const {
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (const Eigen::Vector3d& e : errors) sum += e.array().square();
    return sum;
  }
};

Whitened whitened(const EstimatedPath& path, const DatumPlaces& places) {
  Whitened all;
  for (const Sample& sample : samplesOf(path)) {
    const auto at = places.find(sample.datum);
    const Pose2 place = at == places.end() ? Pose2{} : at->second;
    Eigen::Matrix3d map_from_base = Eigen::Matrix3d::Identity();
    map_from_base.topLeftCorner<2, 2>() = (place * sample.estimate).rotation();
    const Eigen::Matrix3d covariance =
        map_from_base * sample.root.reconstructedMatrix() * map_from_base.transpose();
    const Eigen::LLT<Eigen::Matrix3d> root(covariance);
    all.times.push_back(sample.time_ns);
    all.errors.push_back(root.matrixL().solve(map_from_base * errorOf(sample, place)));
    const Eigen::Vector2d off_m = sample.exact.translation() - place * sample.estimate.translation();
    // With a lower factor, this marginalises θ.
    all.positions.push_back(
        root.matrixL().solve(Eigen::Vector3d(off_m.x(), off_m.y(), 0.0)).head<2>().squaredNorm());
  }
  return all;
}

/// Number of samples that equal one independent sample.
double samplesPerIndependentOne(const Whitened& whitened) {
  const std::vector<Eigen::Vector3d>& e = whitened.errors;
  const Eigen::Array3d power = whitened.power();
  double squares = 0.0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (!(power(k) > 0.0)) continue;
    for (std::size_t lag = 1; lag < e.size(); ++lag) {
      double sum = 0.0;
      for (std::size_t i = lag; i < e.size(); ++i) sum += e[i](k) * e[i - lag](k);
      if (sum <= 0.0) break;
      squares += sum * sum;
    }
  }
  const double all = power.square().sum();
  return all > 0.0 ? 1.0 + 2.0 * squares / all : 1.0;
}

/// ρ² between the errors of two robots at equal times.
double squaredCorrelation(const Whitened& a, const Whitened& b) {
  Eigen::Array3d together = Eigen::Array3d::Zero();
  std::size_t j = 0;
  for (std::size_t i = 0; i < a.times.size(); ++i) {
    while (j < b.times.size() && b.times[j] < a.times[i]) ++j;
    if (j < b.times.size() && b.times[j] == a.times[i]) together += a.errors[i].array() * b.errors[j].array();
  }
  const double scale = std::sqrt(a.power().square().sum() * b.power().square().sum());
  return scale > 0.0 ? std::min(1.0, together.square().sum() / scale) : 0.0;
}

Consistency::Bounds boundsOf(double samples) {
  const double freedom = 3.0 * samples;
  return {chiSquareQuantile(freedom, -kNormal) / samples, chiSquareQuantile(freedom, kNormal) / samples};
}

void setBounds(Consistency& c) {
  c.strict = boundsOf(c.samples);
  c.bounds = boundsOf(c.independent);
}

Consistency consistencyOf(const Whitened& whitened) {
  Consistency c;
  c.samples = static_cast<int>(whitened.errors.size());
  if (c.samples == 0) {
    c.mean = c.position = c.inside = std::numeric_limits<double>::quiet_NaN();
    return c;
  }
  for (const Eigen::Vector3d& e : whitened.errors) {
    c.mean += e.squaredNorm() / c.samples;
    c.inside += (e.squaredNorm() <= kInside ? 1.0 : 0.0) / c.samples;
  }
  for (const double position : whitened.positions) c.position += position / c.samples;
  c.independent = std::max(1.0, c.samples / samplesPerIndependentOne(whitened));
  setBounds(c);
  return c;
}

}  // namespace

Eigen::Vector3d errorOf(const Pose2& estimate, const Pose2& truth) {
  return logarithm(estimate.inverse() * truth);
}

double normalisedSquare(const Pose2& estimate, const Eigen::Matrix3d& covariance, const Pose2& truth) {
  const Eigen::LLT<Eigen::Matrix3d> root(covariance);
  if (root.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return root.matrixL().solve(errorOf(estimate, truth)).squaredNorm();
}

double chiSquareQuantile(double degrees_of_freedom, double z) {
  const double part = 2.0 / (9.0 * degrees_of_freedom);
  const double root = std::max(0.0, 1.0 - part + z * std::sqrt(part));
  return degrees_of_freedom * root * root * root;
}

DatumPlaces placeData(const std::vector<EstimatedPath>& fleet) {
  std::map<std::uint32_t, std::vector<Sample>> by_datum;
  for (const EstimatedPath& path : fleet) {
    for (Sample& sample : samplesOf(path)) by_datum[sample.datum].push_back(std::move(sample));
  }
  DatumPlaces places;
  for (const auto& [datum, samples] : by_datum) places[datum] = placeOf(samples);
  return places;
}

Consistency checkConsistency(const EstimatedPath& path, const DatumPlaces& places) {
  return consistencyOf(whitened(path, places));
}

Consistency checkFleet(const std::vector<EstimatedPath>& fleet, const DatumPlaces& places) {
  std::vector<Whitened> robots;
  std::vector<Consistency> singles;
  for (const EstimatedPath& path : fleet) {
    robots.push_back(whitened(path, places));
    singles.push_back(consistencyOf(robots.back()));
  }
  Consistency all = pooled(singles);
  double variance = 0.0;  // of the sum of ε, in units of the variance of one sample
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const double own =
        singles[i].samples > 0 ? singles[i].samples * samplesPerIndependentOne(robots[i]) : 0.0;
    variance += own;
    for (std::size_t j = 0; j < i && own > 0.0; ++j) {
      const double other =
          singles[j].samples > 0 ? singles[j].samples * samplesPerIndependentOne(robots[j]) : 0.0;
      variance += 2.0 * std::sqrt(own * other) * squaredCorrelation(robots[i], robots[j]);
    }
  }
  if (all.samples == 0) return all;
  all.independent = std::max(1.0, static_cast<double>(all.samples) / variance * all.samples);
  setBounds(all);
  return all;
}

Consistency pooled(const std::vector<Consistency>& runs) {
  Consistency all;
  for (const Consistency& run : runs) {
    if (run.samples == 0) continue;
    all.samples += run.samples;
    all.independent += run.independent;
    all.mean += run.samples * run.mean;
    all.position += run.samples * run.position;
    all.inside += run.samples * run.inside;
  }
  if (all.samples == 0) return consistencyOf({});
  all.mean /= all.samples;
  all.position /= all.samples;
  all.inside /= all.samples;
  setBounds(all);
  return all;
}

}  // namespace omnifleet::evaluation
