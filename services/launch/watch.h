#pragma once

#include <set>
#include <string>
#include <vector>

#include "bus/service_runner.h"
#include "bus/silence.h"

namespace omnifleet::launch {

/// Who of the started processes is silent: told to people at once, and on service/status as the launcher's
/// own state, for a hung process is not seen by whoever comes later.
class Watch {
 public:
  using Clock = bus::Silence::Clock;

  /// `services`: all that were started, "camera r1/fisheye". `host`: the part of the fleet, instance of the
  /// status.
  Watch(bus::Bus& bus, const bus::Topics& topics, const std::vector<std::string>& services,
        const std::string& host, Clock::time_point now);
  /// Says that it has ended, as every service does, so that nobody takes it for silent.
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  /// A word of `who`, one of the services or not.
  void heard(const std::string& who, bool finished, Clock::time_point now);
  /// What is new since the last look: "classifier r1: silent for 5 s", "classifier r1: speaks again".
  std::vector<std::string> look(Clock::time_point now);

 private:
  bus::Bus& bus_;
  std::set<std::string> services_;
  bus::Silence silence_;
  std::set<std::string> silent_;  ///< at the last look
  bus::StatusBoard board_;
  bus::StatusPublisher publisher_;
};

/// "classifier r1 silent for 5 s"; of many as many as there is room for in a status, and how many more.
std::string silentText(const std::vector<bus::Silence::Silent>& silent);

}  // namespace omnifleet::launch
