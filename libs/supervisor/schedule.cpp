#include "supervisor/schedule.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::supervisor {

double Backoff::restartDelay(double uptime_s) {
  early_failures_ = uptime_s < options_.young_s ? early_failures_ + 1 : 0;
  const int doublings = std::max(0, std::min(early_failures_ - 1, 60));
  return std::min(options_.restart_cap_s, std::ldexp(options_.restart_delay_s, doublings));
}

double levelDeadline(std::size_t level_index, std::size_t levels, double budget_s) {
  if (level_index + 1 >= levels) return budget_s;
  return 0.5 * budget_s * static_cast<double>(level_index + 1) / static_cast<double>(levels - 1);
}

}  // namespace omnifleet::supervisor
