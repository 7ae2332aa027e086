#pragma once

#include <cstddef>

#include "supervisor/supervisor.h"

namespace omnifleet::supervisor {

/// When something that died is started again. No clock: the caller says how long it lived.
class Backoff {
 public:
  explicit Backoff(const Options& options) : options_(options) {}

  /// It died after `lived_s` seconds. Delay before the next start, seconds: the first delay, doubled for
  /// every death in a row that came young, up to the cap; whoever lived longer starts over.
  double died(double lived_s);
  /// It died young too often in a row.
  bool hopeless() const { return options_.restart_limit > 0 && young_ >= options_.restart_limit; }

 private:
  Options options_;
  int young_ = 0;
};

/// How long each level has to end before the next one is told to, seconds after the stop began. The last
/// level keeps at least half of the budget: there the map is saved. A level that ends sooner hands on its
/// time.
double levelDeadline(std::size_t level_index, std::size_t levels, double budget_s);

}  // namespace omnifleet::supervisor
