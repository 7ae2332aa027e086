#pragma once

#include <cstddef>

#include "supervisor/supervisor.h"

namespace omnifleet::supervisor {

/// Delay before a failed process is restarted. Has no clock; the caller passes the uptime.
class Backoff {
 public:
  explicit Backoff(const Options& options) : options_(options) {}

  /// A process failed after `uptime_s` seconds. @return delay before the restart, seconds: restart_delay_s,
  /// doubled for every consecutive early failure (uptime below young_s), at most restart_cap_s. A longer
  /// uptime resets it.
  double restartDelay(double uptime_s);
  int earlyFailures() const { return early_failures_; }  ///< consecutive ones

 private:
  Options options_;
  int early_failures_ = 0;
};

/// Time for each level to end before the next level is stopped, seconds since the stop began. The last level
/// keeps at least half of the budget, because it saves the map. A level that ends sooner leaves its time to
/// the next.
double levelDeadline(std::size_t level_index, std::size_t levels, double budget_s);

}  // namespace omnifleet::supervisor
