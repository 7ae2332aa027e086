#include "localizer/ceiling_wait.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::localizer {

CeilingWaitOptions CeilingWaitOptions::read(const options::Section& section) {
  CeilingWaitOptions o;
  section.read("longest_s", o.longest_s, {0.0, 10.0});
  section.read("silent_s", o.silent_s, {0.0, 3600.0});
  section.finish();
  return o;
}

bool CeilingWait::waits(std::optional<TimeNs> time_ns, const std::vector<TimeNs>& newest_ns,
                        Clock::time_point now) {
  const auto silent_ns = static_cast<TimeNs>(std::llround(options_.silent_s * 1e9));
  const bool is_behind = time_ns && std::any_of(newest_ns.begin(), newest_ns.end(), [&](TimeNs newest) {
                           return newest < *time_ns && newest >= *time_ns - silent_ns;
                         });
  if (!is_behind) {
    until_.reset();
    return false;
  }
  if (!until_ || waiting_ns_ != *time_ns) {
    waiting_ns_ = *time_ns;
    until_ =
        now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.longest_s));
  }
  return now < *until_;
}

}  // namespace omnifleet::localizer
