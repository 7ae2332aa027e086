#pragma once

#include <string>
#include <vector>

#include "result.h"

namespace omnifleet::choi {

/// Mean, standard deviation over the seeds, least and most; NaN without values.
struct Spread {
  int seeds = 0;
  double mean = 0.0, deviation = 0.0, least = 0.0, most = 0.0;
  static Spread of(const std::vector<double>& values);
};

/// What the paper prints (paper, literal, ours, with the spread over the seeds), the maps of §IV.4 by number
/// of robots, and Table 1. Lengths in cm.
std::string report(const std::vector<SeedResult>& results);

/// One line of a finished seed, for the progress.
std::string summary(const SeedResult& result);

}  // namespace omnifleet::choi
