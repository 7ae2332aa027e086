#pragma once

#include <cmath>

#include "options/options.h"
#include "scan/map_overlap.h"

namespace omnifleet::estimation {

/// Evidence of common surfaces for a relation of two places or maps against another room: the logarithm of
/// the ratio of their likelihoods.
struct SurfaceEvidence {
  double missed_share = 0.1;   ///< 1, share of the surfaces that contradicts at the right relation, …
  double other_share = 0.4;    ///< 1, … and at the best one of another room
  double independent_m = 0.5;  ///< m, of surface that is one independent observation

  /// Nats.
  double of(const scan::Overlap& overlap) const {
    const double agree = overlap.distinct_agree_m * std::log((1.0 - missed_share) / (1.0 - other_share)),
                 contradict = overlap.distinct_contradict_m * std::log(missed_share / other_share);
    return (agree + contradict) / independent_m;
  }

  /// Reads its keys of a section; does not finish it.
  void readFrom(const options::Section& section) {
    section.read("missed_share", missed_share, {1e-6, 0.5});
    section.read("other_share", other_share, {1e-6, 1.0 - 1e-6});
    section.read("independent_m", independent_m, options::kPositive);
  }
};

}  // namespace omnifleet::estimation
