#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "observation/error_code.h"

namespace omnifleet::bus {

/// State of a service on topic service/status; values of v1::ServiceState.
enum class ServiceState : std::uint8_t {
  kStarting = 0,
  kWaiting = 1,
  kRunning = 2,
  kDegraded = 3,
  kStopping = 4,
  kFinished = 5
};
const char* toString(ServiceState state);

/// The status that a service publishes on topic service/status. The service fills it and the runner reads it,
/// in one thread.
class StatusBoard {
 public:
  using Clock = std::chrono::steady_clock;

  void state(ServiceState state);
  /// Counts one frame or batch. @param latency by the host's monotonic clock @param valid false for a sample
  /// that was passed on as invalid
  void processed(std::chrono::nanoseconds latency, bool valid = true);
  /// Counts inputs that were lost, torn or rejected.
  void dropped(std::uint64_t count = 1);
  /// Total number of samples of the run, if known (recordings).
  void expected(std::uint64_t total) { expected_ = total; }
  /// Reports a problem. It stays in the status until the next one or clearError(). With `degrades` the state
  /// is kDegraded until clearError().
  void report(Message message, bool degrades = false);
  /// Like report(), but without a line in the log: a reported problem that lasts, with its growing duration.
  void update(Message message, bool degrades = false);
  void clearError();
  /// All messages for the log since the last call, oldest first, without repetitions. At most 64; a last one
  /// counts the rest.
  std::vector<Message> takeMessages();

  struct Snapshot {
    ServiceState state = ServiceState::kStarting;
    double rate_hz = 0.0;                               ///< processed per second since the last snapshot
    double latency_p50_ms = 0.0, latency_p99_ms = 0.0;  ///< over the last 1024 samples
    std::uint64_t processed = 0, invalid = 0, drops = 0, expected = 0;
    Message last_error;
  };
  /// Values up to `now`; begins a new interval for the rate.
  Snapshot snapshot(Clock::time_point now);
  /// True when state or error has changed since the last snapshot.
  bool changed() const { return changed_; }

 private:
  ServiceState state_ = ServiceState::kStarting;
  bool degraded_ = false;
  bool changed_ = true;
  Message last_error_;
  std::vector<Message> messages_;  ///< not yet taken
  Message last_message_;
  std::size_t messages_left_out_ = 0;
  std::uint64_t processed_ = 0, invalid_ = 0, drops_ = 0, expected_ = 0, processed_before_ = 0;
  Clock::time_point since_{};
  std::vector<float> latency_ms_;  ///< ring buffer
  std::size_t next_ = 0;
};

}  // namespace omnifleet::bus
