#include "formation/formation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::formation {
namespace {

constexpr TimeNs kPeriod = 200'000'000;

std::map<std::string, RobotBody> threeBodies() {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  body.wheel_separation_m = 0.26;
  return {{"r1", body}, {"r2", body}, {"r3", body}};
}

Formation::Options columnOptions() {
  Formation::Options options;
  options.command.shape = motion::FormationShape::kColumn;
  options.command.distance_m = 0.8;
  options.command.waypoints_m = {{5.0, 0.0}};
  return options;
}

Objects frame(int number) {
  Objects objects;
  objects.robot = "r2";
  objects.acquired_ns = 1'000'000'000 + number * kPeriod;
  objects.sequence = static_cast<std::uint32_t>(number);
  return objects;
}

Track robotAt(double x_m, double y_m, double speed_mps = 0.0) {
  Track track;
  track.id = 7;
  track.kind = ObjectKind::kRobot;
  track.visible = true;
  track.position_m = {x_m, y_m};
  track.velocity_mps = {speed_mps, 0.0};
  return track;
}

PoseEstimate pose(const std::string& robot, int number, const Pose2& map_from_base) {
  PoseEstimate estimate;
  estimate.robot = robot;
  estimate.acquired_ns = 1'000'000'000 + number * kPeriod;
  estimate.valid = true;
  estimate.map_from_base = map_from_base;
  return estimate;
}

double forward(const Formation::Output& output) {
  return 0.5 * (output.command.speeds.left_mps + output.command.speeds.right_mps);
}

TEST(Formation, SelectsFirstNameOrConfiguredLeader) {
  Formation::Options options = columnOptions();
  Formation first("r1", threeBodies(), options);
  EXPECT_EQ(first.process(frame(0), {}).state.role, motion::FormationRole::kLeader);
  options.leader = "r3";
  Formation other("r1", threeBodies(), options);
  const auto output = other.process(frame(0), {});
  EXPECT_EQ(output.state.role, motion::FormationRole::kFollower);
  EXPECT_EQ(output.state.leader, "r3");
  options.leader = "r9";
  EXPECT_THROW(Formation("r1", threeBodies(), options), std::runtime_error);
  EXPECT_THROW(Formation("r9", threeBodies(), columnOptions()), std::runtime_error);
}

TEST(Formation, IsIdleWithoutACommand) {
  Formation formation("r1", threeBodies(), {});
  const auto output = formation.process(frame(0), {pose("r1", -1, {})});
  EXPECT_EQ(output.state.role, motion::FormationRole::kIdle);
  EXPECT_EQ(forward(output), 0.0);
}

TEST(Formation, StopsLeaderWithoutAPose) {
  Formation formation("r1", threeBodies(), columnOptions());
  EXPECT_EQ(forward(formation.process(frame(0), {})), 0.0);
  EXPECT_GT(forward(formation.process(frame(1), {pose("r1", 0, {})})), 0.05);
}

TEST(Formation, PrefersOwnCameraOverPublishedPose) {
  Formation formation("r2", threeBodies(), columnOptions());
  Objects objects = frame(1);
  objects.tracks = {robotAt(1.0, 0.0)};  // published: 0.9 m
  const auto output = formation.process(objects, {pose("r1", 0, {0.9, 0, 0}), pose("r2", 0, {})});
  EXPECT_NEAR(output.state.distance_error_m, 0.2, 1e-9);
  EXPECT_GT(forward(output), 0.05);
}

TEST(Formation, UsesPublishedPoseWhenLeaderIsNotVisible) {
  Formation formation("r2", threeBodies(), columnOptions());
  const auto output = formation.process(frame(1), {pose("r1", 0, {1.1, 0, 0}), pose("r2", 0, {})});
  EXPECT_NEAR(output.state.distance_error_m, 0.3, 1e-9);
  EXPECT_GT(forward(output), 0.05);
}

TEST(Formation, PropagatesPublishedPosesToTheFrame) {
  Formation formation("r2", threeBodies(), columnOptions());
  formation.process(frame(1), {pose("r1", 0, {1.0, 0, 0}), pose("r2", 0, {})});
  Objects objects = frame(2);
  objects.motion.valid = true;
  objects.motion.since_ns = objects.acquired_ns - kPeriod;
  objects.motion.previous_from_current = {0.05, 0.0, 0.0};
  const auto output = formation.process(objects, {pose("r1", 1, {1.06, 0, 0}), pose("r2", 1, {})});
  // r1 drove 6 cm in the last period, half of which enters its speed at once (smoothing): 1.06 + 0.03. r2
  // itself drove 5 cm.
  EXPECT_NEAR(output.state.distance_error_m, 1.09 - 0.05 - 0.8, 1e-9);
}

TEST(Formation, FollowsTrackMotionWithoutPublishedPose) {
  Formation formation("r2", threeBodies(), columnOptions());
  Objects objects = frame(0);
  objects.tracks = {robotAt(0.9, 0.0, 0.2)};
  const auto output = formation.process(objects, {});
  EXPECT_NEAR(output.state.distance_error_m, 0.1, 1e-9);
  EXPECT_GT(forward(output), 0.05);
}

TEST(Formation, SelectsTrackNamedBySighting) {
  Formation formation("r2", threeBodies(), columnOptions());
  PoseEstimate own = pose("r2", 0, {});
  own.sightings = {{7, "r1"}};
  Objects objects = frame(1);
  Track decoy = robotAt(0.8, 0.0);
  decoy.id = 8;
  objects.tracks = {decoy, robotAt(1.1, 0.0)};
  const auto output = formation.process(objects, {pose("r1", 0, {0.85, 0, 0}), own});
  EXPECT_NEAR(output.state.distance_error_m, 0.3, 1e-9);
}

TEST(Formation, StopsAfterUnseenLimitWithoutObservation) {
  Formation formation("r2", threeBodies(), columnOptions());
  Objects objects = frame(0);
  objects.tracks = {robotAt(1.1, 0.0, 0.25)};
  formation.process(objects, {});
  bool moved = false;
  int stopped_at = -1;
  for (int i = 1; i < 30; ++i) {
    const auto output = formation.process(frame(i), {});
    moved = moved || forward(output) > 0.1;
    if (stopped_at < 0 && moved && forward(output) == 0.0) stopped_at = i;
  }
  EXPECT_TRUE(moved);
  // unseen_limit_s is 2 s; braking from 0.4 m/s at 0.6 m/s² takes less than 1 s.
  EXPECT_GT(stopped_at, 5);
  EXPECT_LT(stopped_at, 16);
}

TEST(Formation, StopsOnInvalidFrame) {
  Formation formation("r2", threeBodies(), columnOptions());
  Objects objects = frame(1);
  objects.tracks = {robotAt(1.1, 0.0)};
  EXPECT_GT(forward(formation.process(objects, {})), 0.0);
  objects = frame(2);
  objects.state = FrameState::kDark;
  EXPECT_EQ(forward(formation.process(objects, {})), 0.0);
}

TEST(Formation, IgnoresCommandsOfOtherFleetsAndOldOnes) {
  Formation::Options options = columnOptions();
  options.command.fleet = "demo";
  Formation formation("r1", threeBodies(), options);
  motion::FormationCommand command = options.command;
  command.fleet = "other";
  EXPECT_FALSE(formation.command(command));
  command.fleet = "demo";
  command.acquired_ns = 5;
  command.shape = motion::FormationShape::kLine;
  EXPECT_TRUE(formation.command(command));
  EXPECT_EQ(formation.options().command.shape, motion::FormationShape::kLine);
  command.acquired_ns = 4;
  EXPECT_FALSE(formation.command(command));
}

motion::FormationCommand commandAt(TimeNs time_ns, motion::FormationShape shape) {
  motion::FormationCommand command;
  command.acquired_ns = time_ns;
  command.shape = shape;
  command.distance_m = 0.6;
  return command;
}

TEST(Formation, KeepsWaypointsIfCommandHasNone) {
  Formation formation("r1", threeBodies(), columnOptions());
  EXPECT_TRUE(formation.command(commandAt(5, motion::FormationShape::kLine)));
  EXPECT_FALSE(formation.command(commandAt(5, motion::FormationShape::kWedge)))
      << "same time and sequence as the command in force";
  const auto output = formation.process(frame(1), {pose("r1", 0, {})});
  EXPECT_GT(forward(output), 0.05);
  EXPECT_NEAR(output.state.target_m.x(), 5.0, 1e-9);
  EXPECT_EQ(output.state.command_ns, 5);
}

TEST(Formation, HaltsUntilTheNextCommand) {
  Formation formation("r1", threeBodies(), columnOptions());
  motion::FormationCommand halt = commandAt(5, motion::FormationShape::kLine);
  halt.halt = true;
  EXPECT_TRUE(formation.command(halt));
  EXPECT_EQ(forward(formation.process(frame(1), {pose("r1", 0, {})})), 0.0);
  EXPECT_TRUE(formation.command(commandAt(6, motion::FormationShape::kLine)));
  EXPECT_GT(forward(formation.process(frame(2), {pose("r1", 1, {})})), 0.05);
}

/// State as published by a robot.
motion::FormationState stateOf(const std::string& robot, int number, const std::string& leader,
                               std::uint32_t term, std::uint32_t next_waypoint) {
  motion::FormationState state;
  state.robot = robot;
  state.acquired_ns = 1'000'000'000 + number * kPeriod;
  state.role = robot == leader ? motion::FormationRole::kLeader : motion::FormationRole::kFollower;
  state.leader = leader;
  state.term = term;
  state.next_waypoint = next_waypoint;
  return state;
}

TEST(Formation, ContinuesWaypointsAfterLeaderFailover) {
  Formation::Options options = columnOptions();
  options.command.waypoints_m = {{1.0, 0.0}, {1.0, 5.0}};
  Formation formation("r2", threeBodies(), options);
  Formation::Output output;
  for (int i = 0; i < 30; ++i) {
    std::vector<PoseEstimate> poses{pose("r2", i - 1, {})};
    std::vector<motion::FormationState> states{
        stateOf("r3", i - 1, output.state.leader, output.state.term, 0)};
    if (i < 10) {
      poses.push_back(pose("r1", i - 1, {0.9, 0.0, 0.5 * M_PI}));
      states.push_back(stateOf("r1", i - 1, "r1", 0, 1));  // r1 has passed the first waypoint
    }
    Objects standing = frame(i);
    standing.motion.valid = true;
    standing.motion.since_ns = standing.acquired_ns - kPeriod;
    output = formation.process(standing, poses, states);
    if (i == 15) {
      EXPECT_EQ(output.state.leader, "r1") << "one second of silence is below the timeout";
    }
  }
  EXPECT_EQ(output.state.role, motion::FormationRole::kLeader);
  EXPECT_EQ(output.state.leader, "r2");
  EXPECT_EQ(output.state.term, 1u);
  EXPECT_EQ(output.state.next_waypoint, 1u);
  EXPECT_LT((output.state.target_m - Eigen::Vector2d(1.0, 5.0)).norm(), 1e-9);
}

TEST(Formation, RejectsInvalidOptions) {
  const auto read = [](const std::string& text) {
    return Formation::Options::read(options::Section::parse(text, "formation.yaml"));
  };
  EXPECT_EQ(read("shape: triangle").command.shape, motion::FormationShape::kTriangle);
  EXPECT_THROW(read("shape: heart"), options::Error);
  EXPECT_THROW(read("distance_m: 0"), options::Error);
  EXPECT_THROW(read("avoidance: {margin: 1}"), options::Error);
  EXPECT_THROW(read("{limits: {cruise_mps: 1.0, max_mps: 0.5}}"), options::Error);
}

}  // namespace
}  // namespace omnifleet::formation
