#pragma once

#include <algorithm>
#include <chrono>
#include <functional>

#include "bus/bus.h"

namespace omnifleet::bus {

/// When a live stage may do what nobody waits for. Frames of all robots come together and keep every core
/// busy until they are in the map; then there is time until the next.
class Lull {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kSilence{10};   ///< nothing has come for so long, …
  static constexpr std::chrono::milliseconds kPatience{30};  ///< … or something has since so long

  void heard(Clock::time_point now) {
    last_ = now;
    if (!heard_) first_ = now;
    heard_ = true;
  }
  bool here(Clock::time_point now) const { return now >= begins(); }
  Clock::time_point begins() const {
    return heard_ ? std::min(last_ + kSilence, first_ + kPatience) : Clock::time_point::min();
  }
  /// A slice of the work is done: who is never left in peace does the next one after kPatience.
  void used() { heard_ = false; }

 private:
  bool heard_ = false;  ///< anything since used(), first and last …
  Clock::time_point first_{}, last_{};
};

/// Between two parts of a longer work of that kind: takes what has come and, if there was anything, waits for
/// the next lull. `pull` tells whether there was. Returns at once where the bus stops.
void awaitLull(Bus& bus, const std::function<bool()>& pull);

}  // namespace omnifleet::bus
