#pragma once

#include <atomic>
#include <chrono>

namespace omnifleet::bus {

/// An eventfd that ends Bus::wait(). Unlike a condition variable or a DDS guard condition it may be signalled
/// from a signal handler. Throws std::runtime_error when the kernel has no descriptor left.
class WakeEvent {
 public:
  WakeEvent();
  ~WakeEvent();
  WakeEvent(const WakeEvent&) = delete;
  WakeEvent& operator=(const WakeEvent&) = delete;

  /// Async-signal-safe. A signal before wait() is not lost; several signals count as one.
  void signal() noexcept;
  /// Consumes the signal. False on timeout.
  bool wait(std::chrono::nanoseconds timeout);

 private:
  int fd_;
};

/// The wake event and the stop flag of a bus.
struct BusSignal {
  WakeEvent event;
  std::atomic<bool> stop{false};

  /// Returns true as soon as `met()` does, which is called again after every event. Returns false on timeout
  /// or stop. Events stay available to others.
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
