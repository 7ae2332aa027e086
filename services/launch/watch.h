#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "bus/service_runner.h"
#include "bus/silence.h"

namespace omnifleet::launch {

/// Detects started processes that are silent. Reports them to the user at once, and on service/status as the
/// state of the launcher, because a late joiner cannot detect a hung process.
class Watch {
 public:
  using Clock = bus::Silence::Clock;

  /// @param services all started services, e.g. "camera r1/fisheye" @param host the part of the fleet, used
  /// as instance of the status
  Watch(bus::Bus& bus, const bus::Topics& topics, const std::vector<std::string>& services,
        const std::string& host, Clock::time_point now);
  /// Publishes the state kFinished, as every service does, so that the launcher is not reported as silent.
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  /// A status of service `name` arrived; other services than the started ones are ignored.
  void heard(const std::string& name, bool finished, Clock::time_point now);
  /// The launcher has restarted a process that keeps failing. Counts as its state until no further note has
  /// arrived for 15 s.
  void failing(const std::string& what, Clock::time_point now);
  /// Changes since the last call: "classifier r1: silent for 5 s", "classifier r1: publishes its status
  /// again".
  std::vector<std::string> check(Clock::time_point now);

 private:
  struct Failing {
    std::string what;
    Clock::time_point at;
  };

  bus::Bus& bus_;
  std::set<std::string> services_;
  bus::Silence silence_;
  std::set<std::string> silent_;            ///< at the last check
  std::map<std::string, Failing> failing_;  ///< by process
  bus::StatusBoard board_;
  bus::StatusPublisher publisher_;
};

/// "classifier r1 silent for more than 5 s", comma-separated; "N more" replaces those that do not fit into a
/// status.
std::string silentText(const std::vector<bus::Silence::Silent>& silent);

}  // namespace omnifleet::launch
