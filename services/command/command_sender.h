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

/// What a person wants of the formation; what is not given stays as it is.
struct CommandRequest {
  std::optional<motion::FormationShape> shape;
  std::optional<double> distance_m, angle_rad;
  std::vector<Eigen::Vector2d> waypoints_m;  ///< empty: on along the way ordered before
  bool halt = false;
};

/// Speaks to the formations of a running fleet: learns the command in force, changes what the person wants
/// changed, sends it and waits until every robot says that it obeys. Over the bus interface, one thread.
class CommandSender {
 public:
  CommandSender(bus::Bus& bus, const bus::Topics& topics, const fleet::Fleet& fleet);

  /// Sends once every formation of the fleet is there and has had time to tell the command in force; then
  /// listens. False on timeout; missing() tells who has not answered. Throws std::runtime_error where the
  /// command cannot be written. `now_ns`: system time, by which later commands win.
  bool send(const CommandRequest& request, TimeNs now_ns, std::chrono::nanoseconds timeout);

  /// Robots that have not said that they obey.
  std::vector<std::string> missing() const;
  const motion::FormationCommand& sent() const { return command_; }

 private:
  bool waitForAll(std::chrono::steady_clock::time_point until);
  void learn(std::chrono::steady_clock::time_point until);
  bool listen(std::chrono::steady_clock::time_point until);

  bus::Bus& bus_;
  std::unique_ptr<bus::Writer<v1::FormationCommand>> out_;
  std::unique_ptr<bus::Reader<v1::FormationCommand>> in_;
  std::unique_ptr<bus::Reader<v1::FormationState>> states_;
  std::map<std::string, TimeNs> obeyed_ns_;  ///< per robot of the fleet: command in force there
  motion::FormationCommand command_;
};

}  // namespace omnifleet::services
