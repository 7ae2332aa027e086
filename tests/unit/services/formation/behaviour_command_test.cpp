// A formation service on the fake bus changes its behaviour by command and rejects invalid ones.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "adapters/adapters.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

/// The formation of r1; the test plays the classifier, the localizer and the operator.
class BehaviourCommand : public testing::Test {
 protected:
  BehaviourCommand()
      : bench_("formation", "r1", {}, {}, bus::RunMode::kLive),
        objects_(bench_.bus().writer(bench_.topics.objects, "r1")),
        poses_(bench_.bus().writer(bench_.topics.pose, "r1")),
        commands_(bench_.bus().writer(bench_.topics.formation_command)),
        states_(bench_.bus().reader(bench_.topics.formation_state, "r1")),
        wheels_(bench_.bus().reader(bench_.topics.wheels_command, "r1")) {}

  /// A round room of 1.2 m radius about the robot, seen by a forward camera of 90°.
  v1::FormationState frame() {
    now_ns_ += 200'000'000;
    Objects objects;
    objects.robot = "r1";
    objects.acquired_ns = now_ns_;
    objects.sequence = ++sequence_;
    objects.scan.blind_m = 0.3;
    objects.scan.range_m.assign(360, 1.2f);
    objects.scan.sigma_m.assign(360, 0.002f);
    objects.scan.object.assign(360, 0);
    objects.scan.label.assign(360, RayLabel::kInvalid);
    for (int i = -45; i <= 45; ++i)
      objects.scan.label[static_cast<std::size_t>((i + 360) % 360)] = RayLabel::kObstacle;
    v1::Objects wire;
    adapters::toWire(objects, adapters::RunClock::kSystem, wire);
    EXPECT_TRUE(objects_->write(wire));
    bench_.spin();
    PoseEstimate pose;
    pose.robot = "r1";
    pose.acquired_ns = now_ns_;
    pose.sequence = sequence_;
    pose.valid = true;
    pose.map_from_base = {0.0, 0.0, 0.0};
    v1::Pose pose_wire;
    adapters::toWire(pose, adapters::RunClock::kSystem, 1, pose_wire);
    EXPECT_TRUE(poses_->write(pose_wire));
    bench_.spin();
    v1::FormationState state;
    while (states_->take(state)) {
    }
    return state;
  }

  v1::FormationCommand command(motion::Behaviour behaviour) {
    motion::FormationCommand command;
    command.fleet = "small";
    command.acquired_ns = ++command_ns_;
    command.behaviour = behaviour;
    command.boundary_m = 0.4;
    v1::FormationCommand wire;
    adapters::toWire(command, adapters::RunClock::kSystem, wire);
    return wire;
  }

  test::StageBench bench_;
  std::unique_ptr<bus::Writer<v1::Objects>> objects_;
  std::unique_ptr<bus::Writer<v1::Pose>> poses_;
  std::unique_ptr<bus::Writer<v1::FormationCommand>> commands_;
  std::unique_ptr<bus::Reader<v1::FormationState>> states_;
  std::unique_ptr<bus::Reader<v1::WheelCommand>> wheels_;
  TimeNs now_ns_ = 1'000'000'000, command_ns_ = 0;
  std::uint32_t sequence_ = 0;
};

TEST_F(BehaviourCommand, SwitchesBetweenAllBehavioursWhileTheFleetRuns) {
  EXPECT_EQ(frame().behaviour(), v1::FormationBehaviour::BEHAVIOUR_FORMATION);

  ASSERT_TRUE(commands_->write(command(motion::Behaviour::kExploration)));
  v1::FormationState state;
  bool had_goal = false, turned = false;
  for (int i = 0; i < 12; ++i) {
    state = frame();
    had_goal = had_goal || state.has_goal();
    v1::WheelCommand speeds;
    while (wheels_->take(speeds)) turned = turned || speeds.v_left_mps() != speeds.v_right_mps();
  }
  EXPECT_EQ(state.behaviour(), v1::FormationBehaviour::BEHAVIOUR_EXPLORATION);
  EXPECT_EQ(state.command_ns(), command_ns_);
  EXPECT_EQ(state.view().ray().size(), 91u);
  EXPECT_GT(state.frontiers(), 0u);
  EXPECT_TRUE(had_goal);
  EXPECT_TRUE(turned) << "unknown floor lies beside the view";
  EXPECT_FALSE(state.arrived());

  ASSERT_TRUE(commands_->write(command(motion::Behaviour::kBoundaryFollowing)));
  for (int i = 0; i < 5; ++i) state = frame();
  EXPECT_EQ(state.behaviour(), v1::FormationBehaviour::BEHAVIOUR_BOUNDARY_FOLLOWING);
  EXPECT_TRUE(state.ground_clear());
  EXPECT_FALSE(state.has_goal());

  ASSERT_TRUE(commands_->write(command(motion::Behaviour::kFormation)));
  state = frame();
  EXPECT_EQ(state.behaviour(), v1::FormationBehaviour::BEHAVIOUR_FORMATION);
  EXPECT_TRUE(state.view().ray().empty()) << "the formation publishes no views";
  EXPECT_TRUE(bench_.messages().empty());
}

/// The robot does not obey, so it gives up one frontier after the other. Another robot might still see them.
TEST_F(BehaviourCommand, ReportsUnreachedFloorAtTheEndOfTheRun) {
  ASSERT_TRUE(commands_->write(command(motion::Behaviour::kExploration)));
  v1::FormationState state;
  for (int i = 0; i < 50; ++i) state = frame();
  EXPECT_FALSE(state.skipped().empty());
  EXPECT_TRUE(bench_.messages().empty());
  bench_.drain();
  const std::vector<Message> messages = bench_.messages();
  ASSERT_FALSE(messages.empty());
  EXPECT_EQ(messages[0].code, ErrorCode::kGoalUnreachable);
  EXPECT_THAT(messages[0].text, testing::HasSubstr("stays unknown"));
}

TEST_F(BehaviourCommand, InvalidCommandsAreRejectedAndTheLastOneHolds) {
  ASSERT_TRUE(commands_->write(command(motion::Behaviour::kExploration)));
  frame();
  std::vector<v1::FormationCommand> invalid(4, command(motion::Behaviour::kFormation));
  invalid[0].behaviour(static_cast<v1::FormationBehaviour>(3));
  invalid[1].behaviour(static_cast<v1::FormationBehaviour>(256));  // 0 in eight bits
  invalid[2].boundary_m(0.0);
  invalid[3].boundary_m(std::numeric_limits<double>::quiet_NaN());
  std::vector<Message> messages;
  for (v1::FormationCommand& wire : invalid) {
    wire.header().acquired_ns(++command_ns_);
    ASSERT_TRUE(commands_->write(wire));
    EXPECT_EQ(frame().behaviour(), v1::FormationBehaviour::BEHAVIOUR_EXPLORATION);
    for (const Message& message : bench_.messages()) messages.push_back(message);
  }
  ASSERT_EQ(messages.size(), 1u) << "the same message is reported once";
  EXPECT_EQ(messages[0].code, ErrorCode::kCommandRejected);
  EXPECT_THAT(messages[0].text, testing::HasSubstr("behaviour"));
}

}  // namespace
}  // namespace omnifleet::services
