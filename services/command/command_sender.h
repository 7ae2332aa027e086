#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bus/bus.h"
#include "bus/topics.h"
#include "fleet/fleet.h"
#include "motion/formation_types.h"

namespace omnifleet::services {

/// Changes that the user requests; fields that are not set stay unchanged.
struct CommandRequest {
  std::optional<motion::FormationShape> shape;
  std::optional<double> distance_m, angle_rad;
  std::optional<motion::Behaviour> behaviour;
  std::optional<double> boundary_m;
  std::vector<Eigen::Vector2d> waypoints_m;  ///< empty: the formation continues on its current waypoints
  bool halt = false;
};

/// Sends commands to the formations of a running fleet: receives the current command, applies the requested
/// changes, publishes it and waits until every robot follows it. Uses the bus interface and one thread.
class CommandSender {
 public:
  CommandSender(bus::Bus& bus, const bus::Topics& topics, const fleet::Fleet& fleet);

  /// Waits until every formation of the fleet is matched and the current command has arrived, sends the
  /// changed command, and waits for all robots to follow it. Returns false on timeout; missing() then names
  /// the robots without an answer. Throws std::runtime_error when the command cannot be written. @param
  /// now_ns system time; of two commands the later one is valid
  bool send(const CommandRequest& request, TimeNs now_ns, std::chrono::nanoseconds timeout);

  /// Robots that have not reported that they follow the command.
  std::vector<std::string> missing() const;
  const motion::FormationCommand& sent() const { return command_; }

 private:
  bool waitForFormations(std::chrono::steady_clock::time_point until);
  void receiveCurrent(std::chrono::steady_clock::time_point until);
  bool awaitFollowers(std::chrono::steady_clock::time_point until);

  bus::Bus& bus_;
  std::unique_ptr<bus::Writer<v1::FormationCommand>> out_;
  std::unique_ptr<bus::Reader<v1::FormationCommand>> in_;
  std::unique_ptr<bus::Reader<v1::FormationState>> states_;
  std::map<std::string, TimeNs> command_ns_;  ///< per robot of the fleet: time of the command that it follows
  motion::FormationCommand command_;
};

}  // namespace omnifleet::services
