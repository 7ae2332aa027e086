#pragma once

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>

namespace omnifleet::services {

/// "for more than 10 s", in steps, for a message that is repeated: a log that writes every change stays
/// short. Empty below 1 s.
inline std::string roughDuration(double seconds) {
  constexpr std::array<double, 9> kSteps_s{1, 2, 5, 10, 20, 30, 60, 120, 300};
  if (seconds < kSteps_s.front()) return {};
  double step_s = kSteps_s.front();
  for (const double s : kSteps_s)
    if (s <= seconds) step_s = s;
  constexpr double kStep_s = 600.0;
  if (seconds >= kStep_s) step_s = kStep_s * std::floor(seconds / kStep_s);
  if (step_s < 60.0) return fmt::format("for more than {:.0f} s", step_s);
  return fmt::format("for more than {:.0f} min", step_s / 60.0);
}

}  // namespace omnifleet::services
