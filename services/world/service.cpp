#include "world/service.h"

#include <fmt/format.h>

#include <cmath>

#include "world/dataset_service.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr double kRest_s = 1.0;  // s; the run ends when all commanded speeds are zero for this long

const synthetic::Arena& arenaOf(const fleet::Fleet& fleet) {
  return fleet.arena.value();
}

dataset::RobotRecording recordingOf(const synthetic::ArenaRobot& robot) {
  dataset::RobotRecording recording;
  recording.name = robot.name;
  if (robot.initial_pose_known) recording.initial_pose = robot.initial_map_from_base;
  recording.body = robot.body;
  return recording;
}

}  // namespace

ArenaWorldService::ArenaWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      fleet_(fleet),
      realtime_(context.options.mode == bus::RunMode::kLive),
      options_(world::World::Options::read(fleet.service("world"))),
      world_(arenaOf(fleet), options_, static_cast<std::uint32_t>(fleet.seed)),
      ends_(context, runClock(context.options, fleet)),
      commands_(fleet.arena->robots.size()),
      commanded_ns_(commands_.size()) {
  for (const synthetic::ArenaRobot& robot : fleet.arena->robots) {
    robots_[robot.name] = outputs_.size();
    outputs_.push_back(
        {{context.bus.writer(context.topics.world_truth, robot.name), "world/truth " + robot.name,
          fleet::expectedReaders(fleet, "world/truth", robot.name)},
         {context.bus.writer(context.topics.wheels_odometry, robot.name), "wheels/odometry " + robot.name,
          fleet::expectedReaders(fleet, "wheels/odometry", robot.name)},
         {},
         {},
         makeLaser(robot.name)});
    // A robot without a formation service stands.
    if (!fleet.hasFormation() || !fleet.maps(robot.name)) continue;
    inlets_.push_back(std::make_unique<Inlet<v1::WheelCommand, Command>>(
        context.bus.reader(context.topics.wheels_command, robot.name), merger_, ends_,
        bus::StreamSpec{"wheels/command " + robot.name, robot.name, 0, bus::StreamRole::kInput,
                        streamMode(context.options)}));
  }
  if (context.options.record) {
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      if (fleet.arena->robots[i].has("wheels"))
        outputs_[i].recorder.open(status(), context.options.out + "/recording", fleet.arena->robots[i].name);
    }
  }
  if (!fleet.hasFormation()) drivers_.emplace(world_);
  status().expected(static_cast<std::uint64_t>(fleet.arena->frames()));
}

std::unique_ptr<ArenaWorldService::Laser> ArenaWorldService::makeLaser(const std::string& robot) {
  if (!fleet_.arena->laser || !fleet_.arena->robot(robot).has("laser")) return nullptr;
  auto laser = std::unique_ptr<Laser>(
      new Laser{{context_.bus.writer(context_.topics.laser, robot), "laser " + robot,
                 fleet::expectedReaders(fleet_, "laser", robot)},
                {},
                synthetic::LaserScanner(*fleet_.arena, robot, static_cast<std::uint32_t>(fleet_.seed))});
  if (context_.options.record)
    laser->recorder.open(status(), context_.options.out + "/recording", robot, fleet_.arena->laser->sensor);
  return laser;
}

std::vector<bus::Expectation> ArenaWorldService::expectations() const {
  std::vector<bus::Expectation> all;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const RobotOutputs& outputs = outputs_[i];
    all.push_back(outputs.truth.expectation());
    if (fleet_.arena->robots[i].has("wheels")) all.push_back(outputs.wheels.expectation());
    if (outputs.laser) all.push_back(outputs.laser->out.expectation());
  }
  return all;
}

void ArenaWorldService::start() {
  status().state(bus::ServiceState::kRunning);
  publishFrame();
}

bool ArenaWorldService::pull() {
  bool any = ends_.poll();
  for (auto& inlet : inlets_) {
    any |= inlet->pull(status(), [this](const v1::WheelCommand& wire, Command& command) {
      const auto robot = robots_.find(wire.robot().to_string());
      command = {robot == robots_.end() ? 0 : robot->second, {wire.v_left_mps(), wire.v_right_mps()}};
      return robot != robots_.end() && std::isfinite(wire.v_left_mps()) && std::isfinite(wire.v_right_mps());
    }) > 0;
  }
  return any;
}

bool ArenaWorldService::spin() {
  if (ended_) return false;
  bool any = pull();
  if (!answered()) return any;
  if (last_published_ || (fleet_.end_at_rest && atRest())) {
    finish("");
    ended_ = true;
  } else {
    publishFrame();
  }
  return true;
}

/// True when the next frame may be published: all robots have answered the last one, or (live) it is due.
bool ArenaWorldService::answered() {
  if (realtime_) {
    takeCommands();
    const auto now = steady_clock::now();
    if (wake_at_ && now < *wake_at_) return false;
    const auto period = std::chrono::nanoseconds(fleet_.arena->periodNs());
    wake_at_ = wake_at_ && now - *wake_at_ < period ? *wake_at_ + period : now + period;
    return true;
  }
  if (inlets_.empty()) return true;
  if (!merger_.nextBatch(batch_)) return false;
  for (const auto& item : batch_.inputs) commands_[item.payload.robot] = item.payload.speeds;
  return true;
}

void ArenaWorldService::takeCommands() {
  while (merger_.nextBatch(batch_)) {
    for (const auto& item : batch_.inputs) {
      commands_[item.payload.robot] = item.payload.speeds;
      commanded_ns_[item.payload.robot] = item.time;
    }
  }
}

/// Commands for the next step. Without a formation: the robots drive by themselves. Lockstep: the answers to
/// this frame. Live: the latest commands, zero when too old.
const std::vector<motion::WheelSpeeds>& ArenaWorldService::heldCommands() {
  if (drivers_) commands_ = drivers_->commands(world_);
  if (drivers_) return commands_;
  if (!realtime_) return commands_;
  const auto hold_ns = static_cast<TimeNs>(options_.command_hold_s * 1e9);
  held_ = commands_;
  for (std::size_t i = 0; i < held_.size(); ++i) {
    if (world_.now().time_ns - commanded_ns_[i] > hold_ns) held_[i] = {};
  }
  return held_;
}

void ArenaWorldService::publishFrame() {
  const auto begun = steady_clock::now();
  publishTruth(world_.now());
  publishScans(world_.now());
  last_published_ = world_.finished();
  // The speeds of the interval that begins now answer the previous frame (CONTRIBUTING, "Determinism").
  publishWheels(world_.step(heldCommands()));
  status().processed(steady_clock::now() - begun);
}

void ArenaWorldService::publishTruth(const world::World::State& state) {
  v1::Truth wire;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    wire.robot(fleet_.arena->robots[i].name);
    adapters::fillHeader(state.time_ns, static_cast<std::uint32_t>(state.frame), adapters::RunClock::kSim,
                         wire.header());
    const Pose2& pose = state.map_from_bases[i];
    wire.map_from_base().x(pose.x_m);
    wire.map_from_base().y(pose.y_m);
    wire.map_from_base().theta(pose.theta_rad);
    outputs_[i].truth.write(wire, status());
    outputs_[i].path.push_back({state.time_ns, pose});
  }
}

void ArenaWorldService::publishScans(const world::World::State& state) {
  v1::LaserScan wire;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    if (!outputs_[i].laser) continue;
    Laser& laser = *outputs_[i].laser;
    const dataset::LaserRow& row = laser.scanner.scan(state.frame, state.map_from_bases);
    adapters::toWire(row, fleet_.arena->robots[i].name, static_cast<std::uint32_t>(state.frame),
                     fleet_.arena->laser->sensor.range_max_m, adapters::RunClock::kSim, wire);
    laser.out.write(wire, status());
    laser.recorder.write(status(), [&](dataset::LaserWriter& writer) { writer.write(row); });
  }
}

void ArenaWorldService::publishWheels(const world::World::Driven& driven) {
  v1::WheelOdometry wire;
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    if (!fleet_.arena->robots[i].has("wheels")) continue;
    wire.robot(fleet_.arena->robots[i].name);
    for (const dataset::WheelRow& row : driven.wheels[i]) {
      adapters::fillHeader(row.time_ns, wheel_rows_++, adapters::RunClock::kSim, wire.header());
      wire.v_left_mps(row.left_mps);
      wire.v_right_mps(row.right_mps);
      outputs_[i].wheels.write(wire, status());
      outputs_[i].recorder.write(status(), [&](dataset::WheelsWriter& wheels) { wheels.write(row); });
    }
  }
  for (const world::World::Collision& collision : driven.collisions) {
    const double seconds = 1e-9 * static_cast<double>(world_.now().time_ns - fleet_.arena->start_ns);
    status().report(
        {ErrorCode::kCollision, fmt::format("{} collides with {} at {:.1f} s of the run; reduce its speed or "
                                            "enlarge formation's margin_m",
                                            collision.robot, collision.with, seconds)},
        true);
  }
}

bool ArenaWorldService::atRest() {
  bool still = true;
  for (const motion::WheelSpeeds& speeds : commands_)
    still = still && speeds.left_mps == 0.0 && speeds.right_mps == 0.0;
  moved_ = moved_ || !still;
  resting_frames_ = still && moved_ ? resting_frames_ + 1 : 0;
  return resting_frames_ >= kRest_s * fleet_.arena->rate_hz;
}

void ArenaWorldService::finish(const std::string& reason) {
  for (RobotOutputs& outputs : outputs_) {
    outputs.truth.end(ends_, reason);
    outputs.wheels.end(ends_, reason);
    if (outputs.laser) outputs.laser->out.end(ends_, reason);
  }
  saveTruth();
}

void ArenaWorldService::saveTruth() {
  if (saved_ || context_.options.out.empty()) return;
  saved_ = true;
  const std::string folder = context_.options.out + "/recording";
  try {
    std::vector<dataset::RobotRecording> robots;
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      robots.push_back(recordingOf(fleet_.arena->robots[i]));
      dataset::writeTruthTrajectory(folder, robots.back().name, outputs_[i].path);
    }
    dataset::writeDatasetYaml(folder, robots);
    const double seconds = 1e-9 * static_cast<double>(world_.now().time_ns - fleet_.arena->start_ns);
    dataset::writeTruthScene(folder, fleet_.arena->truthScene(seconds));
    dataset::writeTruthRoom(folder, fleet_.arena->truthRoom());
    if (fleet_.markers) dataset::writeMarkers(folder, *fleet_.markers);
  } catch (const std::runtime_error& error) {
    status().report(fileWriteFailed(error.what()), true);
  }
}

void ArenaWorldService::drain() {
  if (!ended_) finish("stopped");
}

std::unique_ptr<bus::Service> makeWorld(const bus::ServiceContext& context) {
  const auto& o = context.options;
  const fleet::Fleet fleet = fleet::Fleet::load(o.fleet, o.dataset, o.configs);
  if (fleet.arena) return std::make_unique<ArenaWorldService>(context, fleet);
  return std::make_unique<DatasetWorldService>(context, fleet);
}

}  // namespace omnifleet::services
