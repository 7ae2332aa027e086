#pragma once

#include <chrono>
#include <map>
#include <string>

#include "bus/silence.h"
#include "bus/status_board.h"
#include "idl/formation.h"
#include "idl/service.h"

namespace omnifleet::status {

/// The last words of every service of a fleet, as a table for people.
class Table {
 public:
  using Clock = bus::Silence::Clock;

  void put(const v1::ServiceStatus& sample, Clock::time_point now);
  void put(const v1::FormationState& sample);
  /// Sees who is silent now; as often as bus::Silence wants to be asked.
  void look(Clock::time_point now);
  /// One line per service, sorted: state, rate, latency, counters, last error. Who had said nothing for three
  /// seconds at the last look and has not finished is "silent", and for how long. Then who leads the
  /// formation, and which robots last said otherwise.
  std::string text() const;
  /// Somebody is: seen here, or missed by a launcher, which knows who should be there although a hung process
  /// cannot be seen by whoever comes later.
  bool anybodySilent() const;
  std::size_t size() const { return rows_.size(); }

 private:
  std::map<std::string, v1::ServiceStatus> rows_;  ///< by service and instance
  bus::Silence silence_{bus::Silence::Limits{}};
  std::map<std::string, std::string> silent_;         ///< since when, for people
  std::map<std::string, v1::FormationState> states_;  ///< by robot
};

}  // namespace omnifleet::status
