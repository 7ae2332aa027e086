#include "formation/service.h"

#include <fmt/format.h>

#include <algorithm>

#include "adapters/adapters.h"
#include "formation/messages.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

constexpr TimeNs kStandstill_ns = 3000000000;  // a leader that stands for this long has found no path

formation::Formation::Options optionsOf(const fleet::Fleet& fleet) {
  auto options = formation::Formation::Options::read(fleet.service("formation"));
  options.command.fleet = fleet.name;
  return options;
}

/// Robots without a camera or laser have no stages. They stand where the fleet file places them.
std::map<std::string, Pose2> parkedRobots(const fleet::Fleet& fleet) {
  std::map<std::string, Pose2> parked;
  for (const fleet::RobotSpec& robot : fleet.robots) {
    if (!fleet.maps(robot.name) && !robot.has_observations && robot.initial_pose)
      parked[robot.name] = *robot.initial_pose;
  }
  return parked;
}

}  // namespace

FormationService::FormationService(const bus::ServiceContext& context, const fleet::Fleet& fleet)
    : context_(context),
      robot_(fleet.robot(context.options.robot).name),
      clock_(runClock(context.options, fleet)),
      ends_(context, clock_),
      objects_(context.bus.reader(context.topics.objects, robot_), merger_, ends_,
               {"objects " + robot_, robot_, 0, bus::StreamRole::kInput, streamMode(context.options)}),
      poses_(context, fleet, merger_, ends_),
      command_in_(context.bus.reader(context.topics.formation_command)),
      command_out_(context.bus.writer(context.topics.wheels_command, robot_), "wheels/command " + robot_,
                   fleet::expectedReaders(fleet, "wheels/command", robot_)),
      command_repeat_(context.bus.writer(context.topics.formation_command)),
      state_out_(context.bus.writer(context.topics.formation_state, robot_), "formation/state " + robot_,
                 fleet::expectedReaders(fleet, "formation/state", robot_)),
      formation_(robot_, fleet.bodies(), optionsOf(fleet)) {
  formation_.park(parkedRobots(fleet));
  for (const std::string& robot : fleet.mappingRobots()) {
    if (robot == robot_) continue;
    states_.push_back(std::make_unique<Inlet<v1::FormationState, Payload>>(
        context.bus.reader(context.topics.formation_state, robot), merger_, ends_,
        bus::StreamSpec{"formation/state " + robot, robot, 2, bus::StreamRole::kFeedback,
                        streamMode(context.options)}));
  }
}

bool FormationService::pull() {
  bool any = ends_.poll();
  while (command_in_->take(command_)) {
    any = true;
    motion::FormationCommand command;
    if (!adapters::fromWire(command_, command)) {
      status().dropped();
      status().report(formation::commandRejected());
    } else if (formation_.command(command)) {
      // For late joiners.
      if (!command_repeat_->write(command_))
        status().report(writeFailed("formation/command", command_repeat_->error()));
    }
  }
  any |= objects_.pull(status(), [](const v1::Objects& wire, Payload& payload) {
    return orInvalid(adapters::fromWire(wire, payload.emplace<Objects>()));
  }) > 0;
  any |= poses_.pull(status());
  for (auto& inlet : states_) {
    any |= inlet->pull(status(), [](const v1::FormationState& wire, Payload& payload) {
      return adapters::fromWire(wire, payload.emplace<motion::FormationState>());
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
    reportStandstill();
    reportSkipped();
    command_out_.end(ends_);
    state_out_.end(ends_);
    ended_ = any = true;
  }
  return any;
}

void FormationService::process() {
  const auto begun = steady_clock::now();
  received_states_.clear();
  for (auto& item : batch_.feedback) {
    if (const auto* state = std::get_if<motion::FormationState>(&item.payload))
      received_states_.push_back(*state);
  }
  const std::vector<PoseEstimate>& known = poses_.take(batch_.feedback);
  const auto& objects = std::get<Objects>(batch_.inputs.front().payload);
  answer(objects, known);
  status().processed(steady_clock::now() - begun, objects.state == FrameState::kOk);
}

void FormationService::answer(const Objects& objects, const std::vector<PoseEstimate>& known) {
  const formation::Formation::Output output = formation_.process(objects, known, received_states_);
  speeds_.robot(robot_);
  adapters::fillHeader(objects.acquired_ns, objects.sequence, clock_, speeds_.header());
  speeds_.v_left_mps(output.command.speeds.left_mps);
  speeds_.v_right_mps(output.command.speeds.right_mps);
  command_out_.write(speeds_, status());
  adapters::toWire(output.state, clock_, state_);
  state_out_.write(state_, status());
  updateStandstill(output, objects.acquired_ns);
  skipped_ = output.state.skipped;
  if (output.state.arrived) reportSkipped();
}

void FormationService::updateStandstill(const formation::Formation::Output& output, TimeNs now_ns) {
  const motion::WheelSpeeds& speeds = output.command.speeds;
  const bool standing = output.state.behaviour == motion::Behaviour::kFormation &&
                        output.state.role == motion::FormationRole::kLeader && !output.state.arrived &&
                        !output.state.target_m.isZero() && speeds.left_mps == 0.0 && speeds.right_mps == 0.0;
  if (!standing) {
    standing_since_ns_.reset();
    reported_standstill_ = false;
    return;
  }
  left_m_ = output.state.target_m.norm();
  if (!standing_since_ns_) standing_since_ns_ = now_ns;
  if (now_ns - *standing_since_ns_ >= kStandstill_ns) reportStandstill();
}

/// Floor that this robot could not reach and that stayed unknown. Meanwhile another robot may have seen it;
/// so it is reported when all is explored or the run ends.
void FormationService::reportSkipped() {
  const motion::ExplorationGrid& grid = formation_.grid();
  for (const motion::SkippedFrontier& skipped : skipped_) {
    const Eigen::Vector2i cell = grid.cellOf(skipped.place_m);
    // A frontier that stays unknown in full view is a gap in the map, not a problem of the robot.
    if (skipped.looked || !grid.isInside(cell) || grid.at(cell) != motion::Cell::kUnknown) continue;
    const auto same = [&](const Eigen::Vector2d& place_m) { return place_m == skipped.place_m; };
    if (std::any_of(reported_m_.begin(), reported_m_.end(), same)) continue;
    reported_m_.push_back(skipped.place_m);
    status().report(formation::frontierNotReached(robot_, skipped.place_m));
  }
}

/// A run that ends while the leader stands has not reached its goal.
void FormationService::reportStandstill() {
  if (!standing_since_ns_ || reported_standstill_) return;
  reported_standstill_ = true;
  status().report(formation::goalUnreachable(left_m_));
}

void FormationService::drain() {
  if (!ended_) {
    reportStandstill();
    reportSkipped();
    // Without a formation service the robot must not move.
    speeds_.robot(robot_);
    speeds_.v_left_mps(0.0);
    speeds_.v_right_mps(0.0);
    speeds_.header().acquired_ns(speeds_.header().acquired_ns() + 1);
    command_out_.write(speeds_, status());
  }
  command_out_.end(ends_, ended_ ? "" : "stopped");
  state_out_.end(ends_, ended_ ? "" : "stopped");
}

std::unique_ptr<bus::Service> makeFormation(const bus::ServiceContext& context) {
  const auto& o = context.options;
  return std::make_unique<FormationService>(context, fleet::Fleet::load(o.fleet, o.dataset, o.configs));
}

}  // namespace omnifleet::services
