#pragma once

#include <string>
#include <vector>

#include "result.h"

namespace omnifleet::choi {

/// Mean, standard deviation, minimum and maximum over the seeds; NaN without values.
struct Spread {
  int seeds = 0;
  double mean = 0.0, deviation = 0.0, min = 0.0, max = 0.0;
  static Spread of(const std::vector<double>& values);
};

/// Tables of §V with the columns paper, literal and omnifleet (with the spread over the seeds), of the maps
/// of §IV.4 by number of robots, and Table 1. Lengths are in cm.
std::string report(const std::vector<SeedResult>& results);

/// One line on a finished seed, as progress information.
std::string summary(const SeedResult& result);

}  // namespace omnifleet::choi
