#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "supervisor/child.h"

namespace omnifleet::supervisor {

/// Result of EventLoop::wait().
struct Events {
  int stop_signal = 0;               ///< SIGHUP, SIGINT or SIGTERM; 0: none
  std::vector<std::uint64_t> ended;  ///< keys of watched processes that have ended
};

/// epoll over the stop signals (signalfd; the caller has blocked them), one deadline (timerfd) and any number
/// of pidfds.
class EventLoop {
 public:
  EventLoop();

  void watch(const Child& child, std::uint64_t key);
  /// Sleeps until an event, or until `deadline_s` on clock().
  Events wait(double deadline_s);
  static double clock();  ///< monotonic seconds
  static constexpr double kNever = std::numeric_limits<double>::infinity();

 private:
  Descriptor epoll_, signals_, timer_;
};

}  // namespace omnifleet::supervisor
