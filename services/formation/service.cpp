#include "formation/service.h"

#include "adapters/common.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

motion::FormationCommand commandFromWire(const v1::FormationCommand& wire) {
  motion::FormationCommand command;
  command.fleet = wire.fleet().to_string();
  command.acquired_ns = wire.header().acquired_ns();
  command.sequence = wire.header().sequence_number();
  command.shape = static_cast<motion::FormationShape>(wire.shape());
  command.distance_m = wire.distance_m();
  command.angle_rad = wire.angle_rad();
  for (const v1::Point2& point : wire.waypoints()) command.waypoints_m.push_back(adapters::point(point));
  return command;
}

void stateToWire(const motion::FormationState& from, adapters::RunClock clock, v1::FormationState& to) {
  to.robot(from.robot);
  adapters::fillHeader(from.acquired_ns, from.sequence, clock, to.header());
  to.role(static_cast<v1::FormationRole>(from.role));
  to.leader(from.leader);
  to.distance_error_m(from.distance_error_m);
  to.angle_error_rad(from.angle_error_rad);
  to.target(adapters::point(from.target_m));
  to.avoiding(from.avoiding);
  to.arrived(from.arrived);
}

}  // namespace

FormationService::FormationService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      robot_(fleet.robot(context.options.robot).name),
      ends_(context),
      objects_(context.bus.reader(context.topics.objects, robot_), merger_, ends_,
               {"objects " + robot_, robot_, 0, bus::StreamRole::kInput, streamMode(context.options)}),
      command_in_(context.bus.reader(context.topics.formation_command)),
      command_out_(context.bus.writer(context.topics.wheels_command, robot_), "wheels/command " + robot_,
                   fleet::expectedReaders(fleet, "wheels/command", robot_)),
      state_out_(context.bus.writer(context.topics.formation_state, robot_)),
      formation_(robot_, fleet.bodies(), formation::Formation::Options::read(fleet.service("formation"))) {
  for (const std::string& robot : fleet.mappingRobots()) {
    poses_.push_back(std::make_unique<Inlet<v1::Pose, Payload>>(
        context.bus.reader(context.topics.pose, robot), merger_, ends_,
        bus::StreamSpec{"pose " + robot, robot, 1, bus::StreamRole::kFeedback, streamMode(context.options)}));
  }
}

bool FormationService::pull() {
  bool any = ends_.poll();
  while (command_in_->take(command_)) {
    any = true;
    const motion::FormationCommand command = commandFromWire(command_);
    bool finite = adapters::finite(command.distance_m, command.angle_rad) && command.distance_m > 0;
    for (const Eigen::Vector2d& waypoint : command.waypoints_m) finite = finite && waypoint.allFinite();
    if (!finite) {
      status().dropped();
      status().error("formation/command: rejected, a number is not finite or the distance not positive");
    } else {
      formation_.command(command);
    }
  }
  any |= objects_.pull(status(), [](const v1::Objects& wire, Payload& payload) {
    return adapters::fromWire(wire, payload.emplace<Objects>());
  }) > 0;
  for (auto& inlet : poses_) {
    any |= inlet->pull(status(), [](const v1::Pose& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<PoseEstimate>());
    }) > 0;
  }
  return any;
}

bool FormationService::spin() {
  bool any = pull();
  while (merger_.nextBatch(batch_)) {
    process();
    any = true;
  }
  if (!ended_ && merger_.finished()) {
    command_out_.end(ends_);
    ended_ = any = true;
  }
  return any;
}

void FormationService::process() {
  const auto begun = steady_clock::now();
  for (auto& item : batch_.feedback) {
    auto& pose = std::get<PoseEstimate>(item.payload);
    latest_[pose.robot] = pose;
  }
  known_.clear();
  for (const auto& [robot, pose] : latest_) known_.push_back(pose);
  const auto& objects = std::get<Objects>(batch_.inputs.front().payload);
  answer(objects);
  status().processed(steady_clock::now() - begun, objects.state == FrameState::kOk);
}

void FormationService::answer(const Objects& objects) {
  const formation::Formation::Output output = formation_.process(objects, known_);
  const auto clock = runClock(context_.options);
  speeds_.robot(robot_);
  adapters::fillHeader(objects.acquired_ns, objects.sequence, clock, speeds_.header());
  speeds_.v_left_mps(output.command.speeds.left_mps);
  speeds_.v_right_mps(output.command.speeds.right_mps);
  command_out_.write(speeds_, status());
  stateToWire(output.state, clock, state_);
  if (!state_out_->write(state_)) status().error("formation/state: " + state_out_->error());
}

void FormationService::drain() {
  if (!ended_) {
    // A robot that nobody steers any more must stand.
    speeds_.robot(robot_);
    speeds_.v_left_mps(0.0);
    speeds_.v_right_mps(0.0);
    speeds_.header().acquired_ns(speeds_.header().acquired_ns() + 1);
    command_out_.write(speeds_, status());
  }
  command_out_.end(ends_, ended_ ? "" : "stopped");
}

std::unique_ptr<bus::Service> makeFormation(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<FormationService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
