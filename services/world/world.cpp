#include "world/world.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "world/body_gaps.h"

namespace omnifleet::world {
namespace {

double finiteOrZero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

double normal(std::mt19937& generator) {
  // Box–Muller on the raw bits of the generator: std::normal_distribution differs between standard libraries.
  const double u = (static_cast<double>(generator()) + 0.5) / 4294967296.0;
  const double v = (static_cast<double>(generator()) + 0.5) / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * M_PI * v);
}

double towards(double value, double wanted, double most) {
  return value + std::clamp(wanted - value, -most, most);
}

}  // namespace

World::Options World::Options::read(const options::Section& section) {
  Options options;
  section.read("max_wheel_mps", options.max_wheel_mps, {0.01, 10.0});
  section.read("max_wheel_mps2", options.max_wheel_mps2, {0.01, 1000.0});
  section.read("scale_sigma", options.scale_sigma, {0.0, 0.5});
  section.read("noise", options.noise, {0.0, 1.0});
  section.read("slip", options.slip, {0.0, 1.0});
  section.read("rows_per_frame", options.rows_per_frame, {1, 100});
  section.read("inner_steps", options.inner_steps, {1, 1000});
  section.read("command_hold_s", options.command_hold_s, options::kPositive);
  section.read("collisions_stop", options.collisions_stop);
  section.finish();
  return options;
}

World::World(synthetic::Arena arena, const Options& options, std::uint32_t seed)
    : arena_(std::move(arena)), options_(options) {
  state_.time_ns = arena_.frameTimeNs(0);
  const std::size_t robots = arena_.robots.size();
  speeds_.resize(robots);
  rolled_m_.resize(robots);
  driven_.wheels.resize(robots);
  for (std::size_t i = 0; i < robots; ++i) {
    state_.map_from_bases.push_back(arena_.robots[i].initial_map_from_base);
    std::seed_seq sequence{seed, static_cast<std::uint32_t>(i), 0x0d0U};
    noise_.emplace_back(sequence);
    const double left = normal(noise_[i]), right = normal(noise_[i]);
    scale_.emplace_back(1.0 + options_.scale_sigma * left, 1.0 + options_.scale_sigma * right);
  }
}

const World::Driven& World::step(const std::vector<motion::WheelSpeeds>& commands) {
  if (commands.size() != arena_.robots.size())
    throw std::runtime_error("world: step() needs one command per robot");
  for (auto& rows : driven_.wheels) rows.clear();
  driven_.collisions.clear();
  for (int row = 0; row < options_.rows_per_frame; ++row) driveRow(row, commands);
  ++state_.frame;
  state_.time_ns = arena_.frameTimeNs(state_.frame);
  return driven_;
}

void World::driveRow(int row, const std::vector<motion::WheelSpeeds>& commands) {
  const TimeNs begin_ns = state_.time_ns + arena_.periodNs() * row / options_.rows_per_frame;
  const TimeNs end_ns = state_.time_ns + arena_.periodNs() * (row + 1) / options_.rows_per_frame;
  const double row_s = static_cast<double>(end_ns - begin_ns) * 1e-9;
  const double dt_s = row_s / options_.inner_steps;
  std::fill(rolled_m_.begin(), rolled_m_.end(), motion::WheelSpeeds{});
  for (int inner = 0; inner < options_.inner_steps; ++inner) {
    const double time_s = static_cast<double>(begin_ns - arena_.start_ns) * 1e-9 + (inner + 1) * dt_s;
    for (std::size_t robot = 0; robot < arena_.robots.size(); ++robot) {
      driveRobot(robot, commands[robot], dt_s, time_s);
    }
  }
  for (std::size_t robot = 0; robot < arena_.robots.size(); ++robot) {
    const double left_mps = rolled_m_[robot].left_mps / row_s, right_mps = rolled_m_[robot].right_mps / row_s;
    const double left = scale_[robot].x() + options_.noise * normal(noise_[robot]);
    const double right = scale_[robot].y() + options_.noise * normal(noise_[robot]);
    driven_.wheels[robot].push_back({begin_ns, left_mps * left, right_mps * right});
  }
}

void World::driveRobot(std::size_t robot, const motion::WheelSpeeds& command, double dt_s, double time_s) {
  const motion::WheelSpeeds wanted = motion::limited(
      {finiteOrZero(command.left_mps), finiteOrZero(command.right_mps)}, options_.max_wheel_mps);
  motion::WheelSpeeds& speeds = speeds_[robot];
  const double most_mps = options_.max_wheel_mps2 * dt_s;
  speeds = {towards(speeds.left_mps, wanted.left_mps, most_mps),
            towards(speeds.right_mps, wanted.right_mps, most_mps)};
  double left_m = speeds.left_mps * dt_s, right_m = speeds.right_mps * dt_s;
  rolled_m_[robot].left_mps += left_m;
  rolled_m_[robot].right_mps += right_m;
  if (options_.slip > 0.0) {
    left_m *= 1.0 + options_.slip * normal(noise_[robot]);
    right_m *= 1.0 + options_.slip * normal(noise_[robot]);
  }
  const double separation_m = arena_.robots[robot].body.wheel_separation_m;
  const Pose2 next =
      state_.map_from_bases[robot] * motion::rolled(left_m, right_m, separation_m, motion::Integration::kArc);
  const auto time_ns = arena_.start_ns + static_cast<TimeNs>(std::llround(time_s * 1e9));
  if (!collides(robot, next, time_s, time_ns) || !options_.collisions_stop) {
    state_.map_from_bases[robot] = next;
  } else {
    // The obstacle blocks the wheels, and they report it.
    rolled_m_[robot].left_mps -= speeds.left_mps * dt_s;
    rolled_m_[robot].right_mps -= speeds.right_mps * dt_s;
    speeds = {};
  }
}

bool World::collides(std::size_t robot, const Pose2& pose, double time_s, TimeNs time_ns) {
  const RobotBody& body = arena_.robots[robot].body;
  const Pose2& before = state_.map_from_bases[robot];
  bool blocked = false;
  const auto checkContact = [&](const std::string& name, double gap_m, double gap_before_m) {
    report(robot, name, -gap_m, time_ns);
    blocked = blocked || gap_m < gap_before_m;  // a motion that increases the gap is always allowed
  };
  for (std::size_t i = 0; i < arena_.solids.size(); ++i) {
    const Pose2 solid = arena_.solidAt(static_cast<int>(i), time_s);
    const double gap_m = gapToSolid(body, pose, arena_.solids[i], solid);
    if (gap_m >= 0.0) continue;
    checkContact((arena_.solids[i].wall ? "wall " : "obstacle ") + std::to_string(i), gap_m,
                 gapToSolid(body, before, arena_.solids[i], solid));
  }
  for (std::size_t i = 0; i < arena_.robots.size(); ++i) {
    if (i == robot) continue;
    const RobotBody& other = arena_.robots[i].body;
    const Pose2& there = state_.map_from_bases[i];
    const double gap_m = gapToBody(body, pose, other, there);
    if (gap_m >= 0.0) continue;
    checkContact(arena_.robots[i].name, gap_m, gapToBody(body, before, other, there));
  }
  return blocked;
}

void World::report(std::size_t robot, const std::string& with, double depth_m, TimeNs time_ns) {
  const std::string& name = arena_.robots[robot].name;
  for (Collision& known : driven_.collisions) {
    if (known.robot != name || known.with != with) continue;
    known.depth_m = std::max(known.depth_m, depth_m);
    return;
  }
  driven_.collisions.push_back({time_ns, name, with, depth_m});
}

}  // namespace omnifleet::world
