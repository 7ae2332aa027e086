#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Error of a pose: the twist (x, y, θ) in its own base_link from the estimate to the truth, truth = estimate
/// ∘ exp(e). Covariances of poses use the same definition (Barfoot, Furgale 2014). For small heading errors
/// it equals the difference of the coordinates. A large heading error bends the set of possible positions;
/// that set is an ellipse only in twists.
Eigen::Vector3d errorOf(const Pose2& estimate, const Pose2& truth);

/// ε = eᵀP⁻¹e of that error. NaN if the covariance is not positive definite.
double normalisedSquare(const Pose2& estimate, const Eigen::Matrix3d& covariance, const Pose2& truth);

/// Compares errors with the reported covariances (Bar-Shalom, Li, Kirubarajan 2001, §5.4.2). The normalised
/// estimation error squared of a pose, ε = eᵀP⁻¹e of errorOf(), is χ² with 3 degrees of freedom if the
/// covariance is correct, so its mean is 3. A larger mean is over-confident, a smaller one conservative.
struct Consistency {
  struct Bounds {
    double lower = 0.0, upper = 0.0;
  };
  int samples = 0;
  double mean = 0.0;      ///< mean ε (NEES); NaN without samples
  double position = 0.0;  ///< mean ε of x and y alone; 2 is correct, independent of the headings of the truth
  double inside = 0.0;    ///< share of samples below χ²₃(95 %) = 7.815; 0.95 is correct
  Bounds strict;          ///< 95 % interval of the mean of `samples` independent samples
  /// Number of independent samples, because errors of successive poses are correlated: samples ÷ (1 + 2·Σρ²).
  /// ρ is the autocorrelation of the whitened errors in map axes; for normal errors that of ε is its square.
  /// It is summed over lags until it is not positive, per component, weighted by the squared power. A
  /// constant bias counts as one sample.
  double independent = 0.0;
  Bounds bounds;  ///< 95 % interval of the mean of `independent` samples

  bool consistent() const { return mean >= bounds.lower && mean <= bounds.upper; }
};

/// Path of one robot. Poses and covariances are matched by their times. Poses without covariance or without
/// truth are ignored. The truth is interpolated as in poseAt().
struct EstimatedPath {
  std::vector<dataset::StampedPose> truth, estimate;
  std::vector<dataset::StampedCovariance> covariances;
  TimeNs max_gap_ns = 1'000'000'000;
};

/// Pose of `map` in the truth for each reference of the covariances (StampedCovariance::datum).
using DatumPlaces = std::map<std::uint32_t, Pose2>;

/// Pose of each datum for runs with an arbitrary map frame: the rigid motion of all robots that minimises the
/// sum of their ε. Each datum has its own motion, because covariances of one datum do not relate to another.
/// Each motion takes 3 of all degrees of freedom (3 per sample).
DatumPlaces placeData(const std::vector<EstimatedPath>& fleet);

/// @param places motion applied to the poses first; a datum that is not in `places` is not moved
Consistency checkConsistency(const EstimatedPath& path, const DatumPlaces& places = {});

/// Consistency of all robots of a run together. Errors that robots have in common at one time (same initial
/// poses, same landmarks) reduce the number of independent samples by the square of their correlation.
Consistency checkFleet(const std::vector<EstimatedPath>& fleet, const DatumPlaces& places = {});

/// Pools runs without common errors, such as runs with different seeds.
Consistency pooled(const std::vector<Consistency>& runs);

/// Quantile of χ² (Wilson, Hilferty 1931; within 1 % for 10 or more degrees of freedom). `z` is the quantile
/// of the normal distribution.
double chiSquareQuantile(double degrees_of_freedom, double z);

}  // namespace omnifleet::evaluation
