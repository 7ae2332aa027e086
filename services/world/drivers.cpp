#include "world/drivers.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::world {
namespace {

std::map<std::string, RobotBody> bodiesOf(const synthetic::Arena& arena) {
  std::map<std::string, RobotBody> bodies;
  for (const synthetic::ArenaRobot& robot : arena.robots) bodies[robot.name] = robot.body;
  return bodies;
}

}  // namespace

Drivers::Drivers(const World& world, const ObserverOptions& observer_options)
    : observer_options_(observer_options),
      next_(world.arena().robots.size()),
      commands_(next_.size()),
      goal_(next_.size(), 0),
      before_(world.now().map_from_bases) {
  const synthetic::Arena& arena = world.arena();
  formation::Formation::Options options;
  if (arena.has_formation) options = formation::Formation::Options::read(arena.formation);
  for (const synthetic::ArenaRobot& robot : arena.robots) {
    formation::Formation::Options own = options;
    if (!arena.has_formation) {
      own.leader = robot.name;
      own.command.waypoints_m = robot.waypoints_m;
      own.lead.wait_speed = 1.0;  // without a formation there are no followers
    }
    formations_.emplace_back(robot.name, bodiesOf(arena), own);
  }
}

const std::vector<motion::WheelSpeeds>& Drivers::commands(const World& world) {
  const synthetic::Arena& arena = world.arena();
  const double time_s = static_cast<double>(world.now().time_ns - arena.start_ns) * 1e-9;
  for (std::size_t i = 0; i < arena.robots.size(); ++i) {
    commands_[i] = next_[i];
    if (!arena.has_formation && !arena.robots[i].tour_m.empty()) {
      commands_[i] = onTour(world, i);
      on_tour_ = true;
      continue;
    }
    if (!arena.robots[i].speeds.empty()) {
      commands_[i] = fromTable(arena.robots[i], time_s);
      continue;
    }
    Objects objects = observe(world, i, observer_options_);
    if (before_ns_ > 0) objects.motion = exactMotion(before_[i], world.now().map_from_bases[i], before_ns_);
    const formation::Formation::Output output = formations_[i].process(objects, published_, received_states_);
    next_[i] = output.command.speeds;
    states_[output.state.robot] = output.state;
  }
  received_states_.clear();
  for (const auto& [robot, state] : states_) received_states_.push_back(state);
  before_ = world.now().map_from_bases;
  before_ns_ = world.now().time_ns;
  published_ = exactPoses(world);
  return commands_;
}

bool Drivers::arrived() const {
  if (on_tour_) return false;
  for (const auto& [robot, state] : states_) {
    if (!state.arrived && state.role != motion::FormationRole::kIdle) return false;
  }
  for (const motion::WheelSpeeds& speeds : next_) {
    if (speeds.left_mps != 0.0 || speeds.right_mps != 0.0) return false;
  }
  return !states_.empty();
}

/// Turns on the spot towards the next place and drives there. The true pose of this frame counts.
motion::WheelSpeeds Drivers::onTour(const World& world, std::size_t robot) {
  constexpr double kArrived_m = 0.04, kAhead_rad = 0.3, kGain_per_s = 2.0, kMostTurn_radps = 0.8;
  const synthetic::ArenaRobot& spec = world.arena().robots[robot];
  const Pose2& pose = world.now().map_from_bases[robot];
  if ((spec.tour_m[goal_[robot]] - pose.translation()).norm() < kArrived_m)
    goal_[robot] = (goal_[robot] + 1) % spec.tour_m.size();
  const Eigen::Vector2d to = pose.inverse() * spec.tour_m[goal_[robot]];
  const double bearing = std::atan2(to.y(), to.x());
  const double turn = std::clamp(kGain_per_s * bearing, -kMostTurn_radps, kMostTurn_radps);
  const double forward =
      std::abs(bearing) > kAhead_rad ? 0.0 : std::min(spec.tour_mps, kGain_per_s * to.norm());
  const double half_mps = 0.5 * spec.body.wheel_separation_m * turn;
  return {forward - half_mps, forward + half_mps};
}

motion::WheelSpeeds Drivers::fromTable(const synthetic::ArenaRobot& robot, double time_s) const {
  motion::WheelSpeeds speeds;
  for (const Eigen::Vector3d& row : robot.speeds) {
    if (time_s + 1e-9 >= row.x()) speeds = {row.y(), row.z()};
  }
  return speeds;
}

}  // namespace omnifleet::world
