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

std::optional<double> PoseGaps::gapBefore(const std::string& robot, TimeNs time_ns, std::uint32_t sequence) {
  const auto [at, is_first] = last_.try_emplace(robot, Last{time_ns, sequence, 0});
  if (is_first) return std::nullopt;
  Last& last = at->second;
  const TimeNs interval_ns = time_ns - last.time_ns;
  // Frames that were lost count too. A camera that was restarted numbers its frames anew.
  if (sequence > last.sequence) {
    const TimeNs period_ns = interval_ns / static_cast<TimeNs>(sequence - last.sequence);
    last.period_ns = last.period_ns > 0 ? std::min(last.period_ns, period_ns) : period_ns;
  }
  last.time_ns = time_ns;
  last.sequence = sequence;
  const double interval_s = 1e-9 * static_cast<double>(interval_ns);
  const double period_s = 1e-9 * static_cast<double>(last.period_ns);
  if (interval_s > std::max(options_.least_s, options_.least_periods * period_s)) return interval_s;
  return std::nullopt;
}

}  // namespace omnifleet::localizer
