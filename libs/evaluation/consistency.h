#pragma once

#include <vector>

#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Whether errors are as large as the covariances say (Bar-Shalom, Li, Kirubarajan 2001, §5.4.2). The
/// normalised error squared of a pose, ε = eᵀP⁻¹e with e its error in its own base_link (x, y, θ), is χ² with
/// 3 degrees of freedom where the covariance is true: 3 on average. Above: over-confident; below: too modest.
struct Consistency {
  struct Bounds {
    double lower = 0.0, upper = 0.0;
  };
  int samples = 0;
  double mean = 0.0;    ///< NEES; NaN without samples
  double inside = 0.0;  ///< share of single samples below χ²₃(95 %) = 7.815; 0.95 is right
  Bounds strict;        ///< 95 % of means of so many independent samples lie between
  /// Errors of successive poses resemble one another: how many independent samples these are worth, samples
  /// over 1 + 2·Σρ², ρ the autocorrelation of the whitened errors (that of ε is its square where errors are
  /// normal), summed over lags until it is not positive. A bias that lasts makes it one.
  double independent = 0.0;
  Bounds bounds;  ///< likewise, of so many samples

  bool consistent() const { return mean >= bounds.lower && mean <= bounds.upper; }
};

/// Poses are matched with covariances by their times; those without either or without truth do not count.
/// Truth as in poseAt().
Consistency checkConsistency(const std::vector<dataset::StampedPose>& truth,
                             const std::vector<dataset::StampedPose>& estimate,
                             const std::vector<dataset::StampedCovariance>& covariances,
                             TimeNs max_gap_ns = 1'000'000'000);

/// All robots together.
Consistency pooled(const std::vector<Consistency>& robots);

/// Quantile of χ² (Wilson, Hilferty 1931; within 1 % from 10 degrees of freedom). `z`: that of the normal
/// distribution.
double chiSquareQuantile(double degrees_of_freedom, double z);

}  // namespace omnifleet::evaluation
