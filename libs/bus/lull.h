#pragma once

#include <algorithm>
#include <chrono>
#include <functional>

#include "bus/bus.h"

namespace omnifleet::bus {

/// When a live stage may do what nobody waits for. Frames of all robots come together and keep every core
/// busy until they are in the map; then there is time until the next. A stage further down hears of a frame
/// only when the others have worked on it: where bursts come as regularly as frames do, the next one is
/// foreseen.
class Lull {
 public:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;
  static constexpr std::chrono::milliseconds kSilence{10};   ///< nothing has come for so long, …
  static constexpr std::chrono::milliseconds kPatience{30};  ///< … or something has since so long
  /// So long before a burst is due the others may be at work on its frames: as long as they take on a small
  /// computer, and a slice of one's own.
  static constexpr std::chrono::milliseconds kAhead{25};
  static constexpr std::chrono::milliseconds kShortest{60};  ///< periods below leave no time to choose from

  void heard(Time now) {
    if (now - last_ >= kAhead) begin(now);  // shorter pauses are within one
    last_ = now;
    if (!heard_) first_ = now;
    heard_ = true;
  }
  bool here(Time now) const { return now >= begins() && !isDue(now); }
  /// When it is here if nothing comes until then; now where it is.
  Time next(Time now) const {
    const Time at = std::max(now, begins());
    return isDue(at) ? due() + kAhead : at;
  }
  /// A slice of the work is done: who is never left in peace does the next one after kPatience.
  void used() { heard_ = false; }

 private:
  Time begins() const { return heard_ ? std::min(last_ + kSilence, first_ + kPatience) : Time::min(); }
  Time due() const { return burst_ + period_; }
  /// About now a burst is expected that has not come yet.
  bool isDue(Time now) const { return is_steady_ && now >= due() - kAhead && now < due() + kAhead; }
  void begin(Time now) {
    constexpr int kAlike = 4;  // two periods differ by less than this part of one
    const auto before = period_;
    period_ = now - burst_;
    const auto change = std::max(period_, before) - std::min(period_, before);
    is_steady_ = period_ >= kShortest && change < period_ / kAlike;
    burst_ = now;
  }

  bool heard_ = false;  ///< anything since used(), first and last …
  Time first_{}, last_{};
  bool is_steady_ = false;
  Time burst_{};              ///< when the last one began …
  Clock::duration period_{};  ///< … and how long after the one before
};

/// Between two parts of a longer work of that kind: takes what has come, and waits for the next lull where
/// there was anything or is about to be. `pull` tells whether there was. Returns at once where the bus stops.
void awaitLull(Bus& bus, Lull& lull, const std::function<bool()>& pull);

}  // namespace omnifleet::bus
