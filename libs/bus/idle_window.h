#pragma once

#include <algorithm>
#include <chrono>
#include <functional>

#include "bus/bus.h"

namespace omnifleet::bus {

/// Finds the times at which a live stage may do work with no deadline. The frames of all robots arrive in a
/// burst and keep every core busy until they are in the map. The time until the next burst is the idle
/// window. A later stage receives a frame only after the earlier stages have processed it. The start of a
/// burst is therefore predicted when bursts are as regular as frames.
class IdleWindow {
 public:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;
  static constexpr std::chrono::milliseconds kSilence{10};  ///< the window opens after no input for this long
  static constexpr std::chrono::milliseconds kPatience{30};  ///< or after this long since the first input
  /// The window is closed from this long before a burst is due until this long after it. In this time the
  /// earlier stages may be at work on its frames. Measured on a small computer: their time plus one slice of
  /// own work.
  static constexpr std::chrono::milliseconds kAhead{25};
  static constexpr std::chrono::milliseconds kShortest{60};  ///< shorter periods leave no time for a window

  void onInput(Time now) {
    if (now - last_ >= kAhead) begin(now);  // shorter pauses are within one burst
    last_ = now;
    if (!has_input_) first_ = now;
    has_input_ = true;
  }
  bool isOpen(Time now) const { return now >= begins() && !isDue(now); }
  /// The time at which the window opens if no further input arrives; `now` when it is open.
  Time opensAt(Time now) const {
    const Time at = std::max(now, begins());
    return isDue(at) ? due() + kAhead : at;
  }
  /// One slice of work is done. A stage without pauses in its input does the next slice after kPatience.
  void onUse() { has_input_ = false; }

 private:
  Time begins() const { return has_input_ ? std::min(last_ + kSilence, first_ + kPatience) : Time::min(); }
  Time due() const { return burst_ + period_; }
  /// True around the predicted start of a burst that has not begun.
  bool isDue(Time now) const { return is_steady_ && now >= due() - kAhead && now < due() + kAhead; }
  void begin(Time now) {
    constexpr int kAlike = 4;  // the burst is regular when two periods differ by less than period / kAlike
    const auto before = period_;
    period_ = now - burst_;
    const auto change = std::max(period_, before) - std::min(period_, before);
    is_steady_ = period_ >= kShortest && change < period_ / kAlike;
    burst_ = now;
  }

  bool has_input_ = false;  ///< any input since onUse(); the times of the first and the last follow
  Time first_{}, last_{};
  bool is_steady_ = false;
  Time burst_{};              ///< start of the last burst
  Clock::duration period_{};  ///< time between the starts of the last two bursts
};

/// Call between two slices of work with no deadline. Processes new input with `pull` and waits for the next
/// idle window if there was any or a burst is due. `pull` returns whether there was input. Returns at once
/// when the bus is stopping.
void awaitIdleWindow(Bus& bus, IdleWindow& idle_window, const std::function<bool()>& pull);

}  // namespace omnifleet::bus
