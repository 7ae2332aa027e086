#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Error of a pose: the twist (x, y, θ) in its own base_link that leads along an arc from the estimate to the
/// truth, truth = estimate ∘ exp(e), as covariances of poses are meant (Barfoot, Furgale 2014). Where headings
/// are nearly right it is the difference of the coordinates; one that is far off bends the places that a path
/// may have led to, and they are an ellipse in twists alone.
Eigen::Vector3d errorOf(const Pose2& estimate, const Pose2& truth);

/// ε = eᵀP⁻¹e of that error; NaN where the covariance is not positive definite.
double normalisedSquare(const Pose2& estimate, const Eigen::Matrix3d& covariance, const Pose2& truth);

/// Whether errors are as large as the covariances say (Bar-Shalom, Li, Kirubarajan 2001, §5.4.2). The
/// normalised error squared of a pose, ε = eᵀP⁻¹e of errorOf(), is χ² with 3 degrees of freedom where the
/// covariance is true: 3 on average. Above: over-confident; below: too modest.
struct Consistency {
  struct Bounds {
    double lower = 0.0, upper = 0.0;
  };
  int samples = 0;
  double mean = 0.0;      ///< NEES; NaN without samples
  double position = 0.0;  ///< likewise of x and y alone: 2 is right, whatever the truth's headings are worth
  double inside = 0.0;    ///< share of single samples below χ²₃(95 %) = 7.815; 0.95 is right
  Bounds strict;          ///< 95 % of means of so many independent samples lie between
  /// Errors of successive poses resemble one another: how many independent samples these are worth, samples
  /// over 1 + 2·Σρ², ρ the autocorrelation of the whitened errors in map axes (that of ε is its square where
  /// errors are normal), summed over lags until it is not positive, each component by itself and weighing by
  /// the square of its power. A bias that lasts makes it one.
  double independent = 0.0;
  Bounds bounds;  ///< likewise, of so many samples

  bool consistent() const { return mean >= bounds.lower && mean <= bounds.upper; }
};

/// One robot's path. Poses are matched with covariances by their times; those without either or without truth
/// do not count. Truth as in poseAt().
struct ToldPath {
  std::vector<dataset::StampedPose> truth, estimate;
  std::vector<dataset::StampedCovariance> covariances;
  TimeNs max_gap_ns = 1'000'000'000;
};

/// Where `map` lies in the truth, by what the covariances are against (StampedCovariance::datum).
using DatumPlaces = std::map<std::uint32_t, Pose2>;

/// Of runs that nobody told where `map` is: for each datum the rigid motion of all robots together after
/// which the sum of their ε is least. What is against one datum says nothing of where another lies in the
/// truth. Of the 3 degrees of freedom of each sample it takes 3 in all from each datum.
DatumPlaces placeData(const std::vector<ToldPath>& fleet);

/// `places`: where the poses are moved first; a datum that it lacks lies where the truth does.
Consistency checkConsistency(const ToldPath& path, const DatumPlaces& places = {});

/// All robots of a run together: what their errors have in common at one time (all hang on the same starts
/// and the same things) makes their samples worth less, by the square of its correlation, as above.
Consistency checkFleet(const std::vector<ToldPath>& fleet, const DatumPlaces& places = {});

/// Of what has nothing in common, as runs of other seeds.
Consistency pooled(const std::vector<Consistency>& runs);

/// Quantile of χ² (Wilson, Hilferty 1931; within 1 % from 10 degrees of freedom). `z`: that of the normal
/// distribution.
double chiSquareQuantile(double degrees_of_freedom, double z);

}  // namespace omnifleet::evaluation
