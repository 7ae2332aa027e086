#pragma once

#include <chrono>
#include <map>
#include <string>

#include "bus/silence.h"
#include "bus/status_board.h"
#include "idl/formation.h"
#include "idl/service.h"

namespace omnifleet::status {

/// The last status of every service of a fleet, as a table.
class Table {
 public:
  using Clock = bus::Silence::Clock;

  void put(const v1::ServiceStatus& sample, Clock::time_point now);
  void put(const v1::FormationState& sample);
  /// Updates the silent services. Call as often as bus::Silence requires.
  void update(Clock::time_point now);
  /// One line per service, sorted: state, rate, latency, counters, last error. A service is "silent" when its
  /// status is older than three seconds and it has not finished; its line states for how long. The last line
  /// names the leader of the formation and the robots that last followed another one. The line before it is
  /// the sum of the payload that the services of each robot write to topics that other hosts read.
  std::string text() const;
  /// True when a service is silent: found here, or reported by a launcher. The launcher knows the started
  /// services; a late joiner cannot detect a hung process.
  bool anySilent() const;
  std::size_t size() const { return rows_.size(); }

 private:
  std::map<std::string, v1::ServiceStatus> rows_;  ///< by service and instance
  bus::Silence silence_{bus::Silence::Limits{}};
  std::map<std::string, std::string> silent_;         ///< duration of the silence, as text
  std::map<std::string, v1::FormationState> states_;  ///< by robot
};

}  // namespace omnifleet::status
