#include "localizer/pose_gaps.h"

#include <algorithm>

namespace omnifleet::localizer {

PoseGapOptions PoseGapOptions::read(const options::Section& section) {
  PoseGapOptions o;
  section.read("least_s", o.least_s, options::kPositive);
  section.read("least_periods", o.least_periods, {1.0, 1e6});
  section.finish();
  return o;
}

std::optional<double> PoseGaps::gapBefore(const std::string& robot, TimeNs time_ns) {
  const auto [at, is_first] = last_.try_emplace(robot, Last{time_ns, 0});
  if (is_first) return std::nullopt;
  const TimeNs interval_ns = time_ns - at->second.time_ns, usual_ns = at->second.interval_ns;
  at->second = {time_ns, interval_ns};
  const double interval_s = 1e-9 * static_cast<double>(interval_ns);
  const double usual_s = 1e-9 * static_cast<double>(usual_ns);
  if (interval_s > std::max(options_.least_s, options_.least_periods * usual_s)) return interval_s;
  return std::nullopt;
}

}  // namespace omnifleet::localizer
