#pragma once

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "bus/status_board.h"
#include "idl/service.h"

namespace omnifleet::status {

/// The last words of every service of a fleet, as a table for people.
class Table {
 public:
  using Clock = std::chrono::steady_clock;

  void put(const v1::ServiceStatus& sample, Clock::time_point now);
  /// One line per service, sorted: state, rate, latency, counters, last error. Who has said nothing for three
  /// seconds and has not finished is "silent".
  std::string text(Clock::time_point now) const;
  std::size_t size() const { return rows_.size(); }

 private:
  struct Row {
    v1::ServiceStatus sample;
    Clock::time_point heard;
  };
  static std::string stateOf(const Row& row, Clock::time_point now);
  std::map<std::pair<std::string, std::string>, Row> rows_;
};

}  // namespace omnifleet::status
