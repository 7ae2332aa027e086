#pragma once

#include <atomic>
#include <chrono>

namespace omnifleet::bus {

/// An eventfd: what ends a Bus::wait(). Unlike a condition variable or a DDS guard condition it may be
/// signalled from a signal handler. Throws std::runtime_error when the kernel gives none.
class WakeEvent {
 public:
  WakeEvent();
  ~WakeEvent();
  WakeEvent(const WakeEvent&) = delete;
  WakeEvent& operator=(const WakeEvent&) = delete;

  /// Async-signal-safe; signals before a wait are not lost, several count as one.
  void signal() noexcept;
  /// Consumes the signal. False on timeout.
  bool wait(std::chrono::nanoseconds timeout);

 private:
  int fd_;
};

/// What wakes a bus, and its stop flag.
struct BusSignal {
  WakeEvent event;
  std::atomic<bool> stop{false};

  /// True as soon as `met()`; asked again after every event. False on timeout or stop. Consumes no event for
  /// good.
  template <class Predicate>
  bool waitUntil(const Predicate& met, std::chrono::nanoseconds timeout) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    bool result = met();
    while (!result && !stop) {
      const auto left = deadline - std::chrono::steady_clock::now();
      if (left <= std::chrono::nanoseconds(0)) break;
      event.wait(left);
      result = met();
    }
    event.signal();
    return result;
  }
};

}  // namespace omnifleet::bus
