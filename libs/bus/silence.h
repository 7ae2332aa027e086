#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::bus {

/// Finds the services of a fleet whose status has stopped arriving: a process that hangs cannot report it
/// itself. Has no clock; the caller passes the time.
class Silence {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::chrono::seconds after_status{3};   ///< three periods of service/status
    std::chrono::seconds before_first{15};  ///< for expected services: many start at once on a busy machine
  };
  struct Silent {
    std::string name;
    std::chrono::seconds lasts{0};
    bool heard = false;  ///< false: no status has ever arrived
  };

  explicit Silence(Limits limits) : limits_(limits) {}

  /// Adds a service before its first status.
  void expect(const std::string& name, Clock::time_point now);
  /// A status arrived. A `finished` service may be silent.
  void heard(const std::string& name, bool finished, Clock::time_point now);
  /// All services that are silent now, sorted. Call a few times per second. After a pause longer than 1 s the
  /// caller itself was stalled and could not receive, so the pause is not counted.
  std::vector<Silent> silent(Clock::time_point now);

 private:
  struct Record {
    Clock::time_point last;  ///< time of the last status, or of expect()
    bool heard = false, finished = false;
  };
  Limits limits_;
  std::map<std::string, Record> records_;
  std::optional<Clock::time_point> last_check_;
};

/// "silent for 4 s", "not heard in 15 s" (never heard).
std::string toString(const Silence::Silent& silent);

}  // namespace omnifleet::bus
