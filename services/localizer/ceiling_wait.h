#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct CeilingWaitOptions {
  /// s, real time: a frame waits at most this long for the ceiling cameras, live: one period of a camera of
  /// 7 Hz
  double longest_s = 0.15;
  double silent_s = 1.0;  ///< s, a camera without a sample for this long is not waited for

  static CeilingWaitOptions read(const options::Section& section);
};

/// Live, frames and ceiling measurements arrive in any order. Nothing predicts the motion of a robot without
/// wheels between two measurements, and a scan that is matched from a place that is a step off may match
/// something else. So its frames wait until the ceiling cameras have reported their time. A camera that is
/// silent delays nothing.
class CeilingWait {
 public:
  using Clock = std::chrono::steady_clock;

  explicit CeilingWait(const CeilingWaitOptions& options) : options_(options) {}

  /// Whether the next batch waits at `now`.
  /// @param time_ns of the next batch; empty: none is ready
  /// @param newest_ns time of the newest sample of each ceiling camera that has sent any
  bool waits(std::optional<TimeNs> time_ns, const std::vector<TimeNs>& newest_ns, Clock::time_point now);
  /// When the present wait ends at the latest; empty: nothing waits.
  std::optional<Clock::time_point> until() const { return until_; }

 private:
  CeilingWaitOptions options_;
  TimeNs waiting_ns_ = 0;  ///< time of the batch that waits
  std::optional<Clock::time_point> until_;
};

}  // namespace omnifleet::localizer
