#pragma once

#include <string>
#include <utility>
#include <vector>

#include "evaluate/report.h"

namespace omnifleet::evaluate {

/// Means over the robots that have a path; NaN without any.
struct Overall {
  evaluation::PathMetrics path;
  double ate_m = 0.0;
  evaluation::RelativeError rpe;
  double shape_difference = 0.0;  ///< of the robots that have one
  int robots = 0;
};
Overall overall(const Report& report);

/// Robots with covariances, then all of them combined.
std::vector<std::pair<std::string, evaluation::Consistency>> consistencies(const Report& report);

}  // namespace omnifleet::evaluate
