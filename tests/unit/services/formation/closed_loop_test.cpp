// Formation in the simulated world, without cameras: perfect tracks and scans, commands one frame late.

#include <gtest/gtest.h>

#include <cmath>

#include "synthetic/randomised.h"
#include "world/drivers.h"

namespace omnifleet::world {
namespace {

synthetic::Arena arena(const std::string& formation, const std::string& more = "") {
  return synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 60}
floor: {size_m: [7, 4.4]}
robots:
  r1: {initial_pose: [-2.4, 0.0, 0.0]}
  r2: {initial_pose: [-3.0, 0.42, 0.0]}
  r3: {initial_pose: [-3.0, -0.42, 0.0]}
random: {obstacles: [5, 8]}
)" + formation + more,
                                                        "arena.yaml"));
}

const char* const kWedge =
    "formation: {shape: wedge, distance_m: 0.75, angle_rad: 0.6, waypoints: [[-0.6, -0.15], [2.5, 0.15]]}\n";

struct Outcome {
  bool arrived = false;
  std::size_t collisions = 0;
  double goal_error_m = 0.0;
  double gap_m = INFINITY;  ///< m, least gap between bodies and obstacles
};

double leastGap(const World& world) {
  const synthetic::Arena& arena = world.arena();
  double least_m = INFINITY;
  for (std::size_t i = 0; i < arena.robots.size(); ++i) {
    for (const synthetic::Solid& solid : arena.solids) {
      const Eigen::Vector2d here_m = world.now().map_from_bases[i].translation();
      least_m =
          std::min(least_m, solid.distance(here_m, solid.map_from_solid) - arena.robots[i].body.radius_m);
    }
  }
  return least_m;
}

Outcome drive(const synthetic::Arena& the_arena, std::uint32_t seed, const ObserverOptions& observer = {}) {
  World world(the_arena, {}, seed);
  Drivers drivers(world, observer);
  Outcome run;
  while (!world.finished() && !drivers.arrived()) {
    run.collisions += world.step(drivers.commands(world)).collisions.size();
    run.gap_m = std::min(run.gap_m, leastGap(world));
  }
  run.arrived = drivers.arrived();
  run.goal_error_m = (world.now().map_from_bases[0].translation() - Eigen::Vector2d(2.5, 0.15)).norm();
  return run;
}

class ArenasWithObstacles : public testing::TestWithParam<const char*> {};

/// Perfect tracks and scans (arenas_test.cpp uses cameras). The goal is free. An obstacle near it may keep
/// followers out of their places, but the leader still arrives.
TEST_P(ArenasWithObstacles, ArriveWithoutCollision) {
  const std::string formation =
      std::string("formation: {shape: ") + GetParam() +
      ", distance_m: 0.75, angle_rad: 0.6, waypoints: [[-0.6, -0.15], [2.5, 0.15]]}\n";
  for (std::uint32_t seed = 1000; seed < 1010; ++seed) {
    const Outcome run = drive(synthetic::randomised(arena(formation), seed), seed);
    EXPECT_TRUE(run.arrived) << seed;
    EXPECT_EQ(run.collisions, 0u) << seed;
    EXPECT_LT(run.goal_error_m, 0.08) << seed;
  }
}

/// As above, with a body that hides as much of the floor as those of the demo. The least margin is also kept
/// to obstacles that are too near to be seen.
TEST_P(ArenasWithObstacles, KeepMarginToObstaclesHiddenByTheBody) {
  const std::string formation =
      std::string("formation: {shape: ") + GetParam() +
      ", distance_m: 0.75, angle_rad: 0.6, waypoints: [[-0.6, -0.15], [2.5, 0.15]]}\n";
  ObserverOptions observer;
  observer.blind_m = 0.42;
  for (std::uint32_t seed = 1000; seed < 1010; ++seed) {
    const Outcome run = drive(synthetic::randomised(arena(formation), seed), seed, observer);
    EXPECT_TRUE(run.arrived) << seed;
    EXPECT_EQ(run.collisions, 0u) << seed;
    EXPECT_LT(run.goal_error_m, 0.08) << seed;
    EXPECT_GT(run.gap_m, motion::Avoidance::Options{}.least_margin_m) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(All, ArenasWithObstacles, testing::Values("line", "column", "wedge", "triangle"),
                         [](const auto& shape) { return std::string(shape.param); });

class SteadyShapes : public testing::TestWithParam<const char*> {};

TEST_P(SteadyShapes, KeepFifteenMillimetresRmsStraightAhead) {
  // 5 m straight ahead, from a formation that is not yet in place. The last half of the path counts.
  const std::string formation =
      std::string("formation: {shape: ") + GetParam() +
      ", distance_m: 0.8, angle_rad: 0.6, waypoints: [[3.2, 0.0]], limits: {cruise_mps: 0.2}}\n";
  World world(arena(formation), {}, 3);
  Drivers drivers(world);
  double squares = 0.0;
  int n = 0;
  while (!world.finished() && !drivers.arrived()) {
    world.step(drivers.commands(world));
    const double leader_x_m = world.now().map_from_bases[0].x_m;
    if (leader_x_m < 0.0 || leader_x_m > 2.4) continue;
    for (const char* follower : {"r2", "r3"}) {
      const motion::FormationState& state = drivers.states().at(follower);
      squares += state.target_m.squaredNorm();
      ++n;
    }
  }
  ASSERT_GT(n, 50);
  EXPECT_TRUE(drivers.arrived());
  // Issue 3 requires 3 cm RMS with real cameras. With perfect tracks the law itself must stay well below.
  RecordProperty("rms_mm", std::to_string(1e3 * std::sqrt(squares / n)));
  EXPECT_LT(std::sqrt(squares / n), 0.015) << GetParam();
}

INSTANTIATE_TEST_SUITE_P(All, SteadyShapes, testing::Values("line", "column", "wedge", "triangle"),
                         [](const auto& shape) { return std::string(shape.param); });

TEST(ClosedLoop, FormationTurnsWithTheLeaderForAnObstacle) {
  const synthetic::Arena blocked =
      arena(kWedge, "obstacles:\n  - {kind: cylinder, pose: [0.6, 0.0, 0], radius_m: 0.15, height_m: 0.2}\n");
  World world(blocked, {}, 1);
  Drivers drivers(world);
  bool leader_avoided = false;
  std::size_t collisions = 0;
  double leader_aside_m = 0.0;
  while (!world.finished() && !drivers.arrived()) {
    collisions += world.step(drivers.commands(world)).collisions.size();
    leader_avoided = leader_avoided || drivers.states().at("r1").avoiding;
    const Pose2& leader = world.now().map_from_bases[0];
    if (std::abs(leader.x_m - 0.6) < 0.05) leader_aside_m = std::abs(leader.y_m);
  }
  EXPECT_TRUE(drivers.arrived());
  EXPECT_TRUE(leader_avoided);
  EXPECT_EQ(collisions, 0u);
  EXPECT_GT(leader_aside_m, 0.30);
}

TEST(ClosedLoop, ColumnIsStraightAfterLastRobotPassedTheBend) {
  const synthetic::Arena bend = synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 60}
floor: {size_m: [7, 6]}
robots:
  r1: {initial_pose: [-1.5, -2.0, 0.0]}
  r2: {initial_pose: [-2.2, -2.0, 0.0]}
  r3: {initial_pose: [-2.9, -2.0, 0.0]}
formation: {shape: column, distance_m: 0.7, waypoints: [[1.0, -2.0], [1.0, 2.5]], limits: {cruise_mps: 0.2}}
)",
                                                                               "bend.yaml"));
  World world(bend, {}, 1);
  Drivers drivers(world);
  double turned_s = 0.0, straight_s = 0.0, now_s = 0.0;
  while (!world.finished() && !drivers.arrived()) {
    world.step(drivers.commands(world));
    now_s += 0.2;
    const auto& poses = world.now().map_from_bases;
    if (turned_s == 0.0 && poses[0].theta_rad > 1.4) turned_s = now_s;
    const double out_m = (poses[0].inverse() * poses[2].translation() - Eigen::Vector2d(-1.4, 0.0)).norm();
    if (out_m > 0.15) straight_s = now_s;
  }
  EXPECT_TRUE(drivers.arrived());
  ASSERT_GT(turned_s, 0.0);
  RecordProperty("seconds", std::to_string(straight_s - turned_s));
  // The last robot is two distances behind: 7 s at 0.2 m/s, plus 2 s for the rounding of the bend.
  EXPECT_LT(straight_s - turned_s, 9.0);
}

TEST(ClosedLoop, FormationQueuesThroughADoorway) {
  // 80 cm between two walls: two robots of 30 cm abreast would touch them.
  const synthetic::Arena door = arena(kWedge, R"(obstacles:
  - {kind: box, pose: [0.4, 1.2, 0], size_m: [0.2, 1.6], height_m: 0.2}
  - {kind: box, pose: [0.4, -1.2, 0], size_m: [0.2, 1.6], height_m: 0.2}
)");
  World world(door, {}, 1);
  Drivers drivers(world);
  std::size_t collisions = 0;
  double widest_m = 0.0, narrowest = 1.0;
  bool narrowed = false;
  while (!world.finished() && !drivers.arrived()) {
    collisions += world.step(drivers.commands(world)).collisions.size();
    for (std::size_t i = 0; i < 3; ++i) {
      const Pose2& pose = world.now().map_from_bases[i];
      if (std::abs(pose.x_m - 0.4) < 0.1) widest_m = std::max(widest_m, std::abs(pose.y_m));
    }
    for (const char* follower : {"r2", "r3"}) {
      const double narrowing = drivers.states().at(follower).narrowing;
      narrowed = narrowed || narrowing > 0.5;
      narrowest = narrowing;
    }
  }
  EXPECT_TRUE(drivers.arrived());
  EXPECT_EQ(collisions, 0u);
  EXPECT_LT(widest_m, 0.25);
  EXPECT_TRUE(narrowed);
  EXPECT_LT(narrowest, 0.1) << "the formation spreads out again behind the door";
  const Pose2& leader = world.now().map_from_bases[0];
  motion::FormationCommand wedge;
  wedge.distance_m = 0.75;
  const auto places = motion::placesOf(wedge, 3);
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_LT((world.now().map_from_bases[i].translation() - leader * places[i]).norm(), 0.08) << i;
  }
}

TEST(ClosedLoop, ObstacleBeyondTheGoalDoesNotNarrow) {
  // 35 cm ahead of r2's body in its final place. It would be in the way only if all robots drove on.
  const std::string beyond = R"(
frames: {rate_hz: 5, duration_s: 60}
floor: {size_m: [7, 4.4]}
robots:
  r1: {initial_pose: [-1.5, 0.0, 0.0]}
  r2: {initial_pose: [-1.5, 0.75, 0.0]}
  r3: {initial_pose: [-1.5, -0.75, 0.0]}
obstacles:
  - {kind: cylinder, pose: [2.15, 0.75, 0], radius_m: 0.15, height_m: 0.2}
)";
  const char* const kFormation = "formation: {shape: line, distance_m: 0.75, waypoints: [[1.5, 0.0]]}";
  World world(synthetic::Arena::read(options::Section::parse(beyond + kFormation, "beyond.yaml")), {}, 1);
  Drivers drivers(world);
  while (!world.finished() && !drivers.arrived()) {
    world.step(drivers.commands(world));
    EXPECT_EQ(drivers.states().at("r2").narrowing, 0.0);
  }
  EXPECT_TRUE(drivers.arrived());
  motion::FormationCommand line;
  line.shape = motion::FormationShape::kLine;
  line.distance_m = 0.75;
  const auto places = motion::placesOf(line, 3);
  const auto& at = world.now().map_from_bases;
  for (std::size_t i = 1; i < 3; ++i) EXPECT_LT((at[i].translation() - at[0] * places[i]).norm(), 0.08) << i;
}

TEST(ClosedLoop, RobotsWithoutFormationDriveTheirOwnPaths) {
  const synthetic::Arena alone = synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 30}
robots:
  r1: {initial_pose: [0, 0, 0], waypoints: [[1.0, 0.5]]}
  r2: {initial_pose: [0, 1.5, 0], waypoints: [[-1.0, 1.5]]}
  r3: {initial_pose: [0, -1.5, 0], speeds: [0, 0.1, 0.1, 2, 0, 0]}
)",
                                                                                "alone.yaml"));
  World world(alone, {}, 1);
  Drivers drivers(world);
  while (!world.finished()) world.step(drivers.commands(world));
  const auto& poses = world.now().map_from_bases;
  EXPECT_LT((poses[0].translation() - Eigen::Vector2d(1.0, 0.5)).norm(), 0.08);
  EXPECT_LT((poses[1].translation() - Eigen::Vector2d(-1.0, 1.5)).norm(), 0.08);
  EXPECT_NEAR(poses[2].x_m, 0.2, 0.02);
}

}  // namespace
}  // namespace omnifleet::world
