#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace omnifleet::bus {

/// What a service tells people about itself (topic service/status).
/// Values of v1::ServiceState.
enum class ServiceState : std::uint8_t {
  kStarting = 0,
  kWaiting = 1,
  kRunning = 2,
  kDegraded = 3,
  kStopping = 4,
  kFinished = 5
};
const char* toString(ServiceState state);

/// Filled by the service, read by the runner. Not thread-safe: same thread.
class StatusBoard {
 public:
  using Clock = std::chrono::steady_clock;

  void state(ServiceState state);
  /// One frame or batch handled; its latency on the host's monotonic clock. `valid` is false for what was
  /// passed on as invalid.
  void processed(std::chrono::nanoseconds latency, bool valid = true);
  /// Inputs that were given up: lost, torn, rejected.
  void dropped(std::uint64_t count = 1);
  /// How many samples the whole run has, where known (recordings).
  void expected(std::uint64_t total) { expected_ = total; }
  /// The last thing that went wrong; stays until the next one or clearError(). Also makes the state kDegraded
  /// until clearError() when `degrades`.
  void error(const std::string& text, bool degrades = false);
  void clearError();
  /// The problems told by error() since the last call, oldest first, a repeated one once: for the log, which
  /// must not lose those that a later one replaced. At most 64; the last line then says how many more.
  std::vector<std::string> takeProblems();

  struct Snapshot {
    ServiceState state = ServiceState::kStarting;
    double rate_hz = 0.0;                               ///< processed per second since the last snapshot
    double latency_p50_ms = 0.0, latency_p99_ms = 0.0;  ///< over the last 1024
    std::uint64_t processed = 0, invalid = 0, drops = 0, expected = 0;
    std::string last_error;
  };
  /// Figures up to `now`; starts a new interval for the rate.
  Snapshot snapshot(Clock::time_point now);
  /// Something that people should see at once has changed since the last snapshot (state, error).
  bool changed() const { return changed_; }

 private:
  ServiceState state_ = ServiceState::kStarting;
  bool degraded_ = false;
  bool changed_ = true;
  std::string last_error_;
  std::vector<std::string> problems_;  ///< not yet taken
  std::string last_problem_;
  std::size_t problems_left_out_ = 0;
  std::uint64_t processed_ = 0, invalid_ = 0, drops_ = 0, expected_ = 0, processed_before_ = 0;
  Clock::time_point since_{};
  std::vector<float> latency_ms_;  ///< ring
  std::size_t next_ = 0;
};

}  // namespace omnifleet::bus
