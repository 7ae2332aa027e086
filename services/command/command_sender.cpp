#include "command/command_sender.h"

#include <stdexcept>
#include <tuple>

#include "adapters/adapters.h"
#include "formation/formation.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr auto kReceiveTime =
    std::chrono::milliseconds(300);  // for the current command to arrive after the match
constexpr auto kPollPeriod = std::chrono::milliseconds(50);

}  // namespace

CommandSender::CommandSender(bus::Bus& bus, const bus::Topics& topics, const fleet::Fleet& fleet)
    : bus_(bus),
      out_(bus.writer(topics.formation_command)),
      in_(bus.reader(topics.formation_command)),
      states_(bus.reader(topics.formation_state)),
      command_(formation::Formation::Options::read(fleet.service("formation")).command) {
  command_.fleet = fleet.name;
  for (const std::string& robot : fleet.mappingRobots()) command_ns_[robot] = -1;
}

bool CommandSender::send(const CommandRequest& request, TimeNs now_ns, std::chrono::nanoseconds timeout) {
  const auto until = steady_clock::now() + timeout;
  if (!waitForFormations(until)) return false;
  receiveCurrent(std::min(until, steady_clock::now() + kReceiveTime));
  if (request.shape) command_.shape = *request.shape;
  if (request.distance_m) command_.distance_m = *request.distance_m;
  if (request.angle_rad) command_.angle_rad = *request.angle_rad;
  if (request.behaviour) command_.behaviour = *request.behaviour;
  if (request.boundary_m) command_.boundary_m = *request.boundary_m;
  command_.waypoints_m = request.waypoints_m;
  command_.halt = request.halt;
  command_.acquired_ns = std::max(now_ns, command_.acquired_ns + 1);
  command_.sequence = 0;
  v1::FormationCommand wire;
  adapters::toWire(command_, adapters::RunClock::kSystem, wire);
  if (!out_->write(wire)) throw std::runtime_error("formation/command: " + out_->error());
  return awaitFollowers(until);
}

/// The own reader and writer match each other too.
bool CommandSender::waitForFormations(steady_clock::time_point until) {
  const int formations = static_cast<int>(command_ns_.size());
  while (out_->matched() < formations + 1 || in_->matched() < formations + 1) {
    if (bus_.stopping() || steady_clock::now() >= until) return false;
    bus_.wait(kPollPeriod);
  }
  return true;
}

void CommandSender::receiveCurrent(steady_clock::time_point until) {
  v1::FormationCommand wire;
  while (steady_clock::now() < until && !bus_.stopping()) {
    motion::FormationCommand command;
    while (in_->take(wire)) {
      if (!adapters::fromWire(wire, command) || command.fleet != command_.fleet) continue;
      if (std::tie(command.acquired_ns, command.sequence) >=
          std::tie(command_.acquired_ns, command_.sequence)) {
        command_ = command;
      }
    }
    bus_.wait(kPollPeriod);
  }
}

bool CommandSender::awaitFollowers(steady_clock::time_point until) {
  v1::FormationState wire;
  while (true) {
    while (states_->take(wire)) {
      const auto robot = command_ns_.find(wire.robot().to_string());
      if (robot != command_ns_.end()) robot->second = wire.command_ns();
    }
    if (missing().empty()) return true;
    if (bus_.stopping() || steady_clock::now() >= until) return false;
    bus_.wait(kPollPeriod);
  }
}

std::vector<std::string> CommandSender::missing() const {
  std::vector<std::string> robots;
  for (const auto& [robot, command_ns] : command_ns_) {
    if (command_ns < command_.acquired_ns || command_ns < 0) robots.push_back(robot);
  }
  return robots;
}

}  // namespace omnifleet::services
