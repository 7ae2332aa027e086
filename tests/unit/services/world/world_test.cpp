#include "world/world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "motion/wheel_integrator.h"

namespace omnifleet::world {
namespace {

synthetic::Arena arena(const std::string& more = "") {
  return synthetic::Arena::read(
      options::Section::parse("frames: {rate_hz: 5, duration_s: 20}\nrobots:\n  r1: {initial_pose: [0, 0, "
                              "0.5]}\n  r2: {initial_pose: [0, 2, 0]}\n" +
                                  more,
                              "arena.yaml"));
}

World::Options exact() {
  World::Options options;
  options.scale_sigma = 0.0;
  options.noise = 0.0;
  options.max_wheel_mps2 = 1000.0;
  return options;
}

TEST(World, DrivesArcOfEquation1) {
  World world(arena(), exact(), 1);
  for (int i = 0; i < 10; ++i) world.step({{0.2, 0.3}, {}});
  const Pose2 expected = Pose2{0, 0, 0.5} * motion::rolled(0.4, 0.6, 0.26, motion::Integration::kArc);
  // At 1000 m/s² the first inner step of 10 ms reaches the speed, so no distance is lost.
  EXPECT_LT((world.now().map_from_bases[0].vector() - expected.vector()).norm(), 1e-9);
  EXPECT_EQ(world.now().map_from_bases[1].vector(), Eigen::Vector3d(0, 2, 0));
  EXPECT_EQ(world.now().frame, 10);
  EXPECT_EQ(world.now().time_ns, 1'002'000'000'000);
}

TEST(World, ReportedWheelSpeedsIntegrateToTruth) {
  World::Options options = exact();
  options.max_wheel_mps2 = 0.8;
  options.rows_per_frame = 4;
  World world(arena(), options, 1);
  motion::WheelIntegrator wheels(0.26, {});
  Pose2 pose{0, 0, 0.5};
  wheels.motionTo(world.now().time_ns);
  for (int i = 0; i < 40; ++i) {
    const double swing = 0.1 * std::sin(0.3 * i);
    const World::Driven& driven = world.step({{0.25 - swing, 0.25 + swing}, {}});
    ASSERT_EQ(driven.wheels[0].size(), 4u);
    for (const dataset::WheelRow& row : driven.wheels[0])
      wheels.add(row.time_ns, row.left_mps, row.right_mps);
    const Motion motion = wheels.motionTo(world.now().time_ns);
    ASSERT_TRUE(motion.valid);
    pose = pose * motion.previous_from_current;
  }
  // Rows hold the mean speed of 50 ms while the motors still change it, so the path within a row is not
  // exactly an arc.
  EXPECT_LT((pose.vector() - world.now().map_from_bases[0].vector()).norm(), 1e-3);
}

TEST(World, OdometryHasConfiguredBiasAndNoise) {
  World::Options options = exact();
  options.scale_sigma = 0.02;
  options.noise = 0.03;
  double biases = 0.0, noises = 0.0;
  int n = 0, rows = 0;
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    World world(arena(), options, seed);
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < 50; ++i) {
      const double ratio = world.step({{0.1, 0.1}, {}}).wheels[0][0].left_mps / 0.1 - 1.0;
      sum += ratio;
      squares += ratio * ratio;
    }
    const double mean = sum / 50;
    biases += mean * mean;
    noises += squares - 50 * mean * mean;
    rows += 49;
    ++n;
  }
  // 200 draws give σ to 5 %. The mean of 50 noisy rows adds (0.03)²/50 to the variance of the biases.
  EXPECT_NEAR(std::sqrt(biases / n - 0.0009 / 50), 0.02, 0.003);
  EXPECT_NEAR(std::sqrt(noises / rows), 0.03, 0.001);
}

TEST(World, EqualSeedsGiveEqualRuns) {
  for (const std::uint32_t other : {4U, 5U}) {
    World a(arena(), {}, 4), b(arena(), {}, other);
    bool same = true;
    for (int i = 0; i < 20; ++i) {
      const double a_left = a.step({{0.2, 0.21}, {0.1, 0.1}}).wheels[1][0].left_mps;
      same = same && a_left == b.step({{0.2, 0.21}, {0.1, 0.1}}).wheels[1][0].left_mps;
    }
    EXPECT_EQ(same, other == 4);
  }
}

TEST(World, NoiseOfRobotDoesNotDependOnOthers) {
  World a(arena(), {}, 4), b(arena(), {}, 4);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(a.step({{0.2, 0.2}, {0.1, 0.1}}).wheels[1][0].left_mps,
              b.step({{0.0, 0.0}, {0.1, 0.1}}).wheels[1][0].left_mps);
  }
}

TEST(World, LimitsSpeedAndAcceleration) {
  World::Options options = exact();
  options.max_wheel_mps = 0.5;
  options.max_wheel_mps2 = 1.0;
  World world(arena(), options, 1);
  const World::Driven& first = world.step({{2.0, 2.0}, {std::nan(""), INFINITY}});
  EXPECT_NEAR(first.wheels[0][0].left_mps, 0.1 * 1.05, 1e-9);  // from 0 to 0.2 m/s in 20 steps
  EXPECT_EQ(first.wheels[1][0].left_mps, 0.0);                 // a non-finite command stops the wheel
  for (int i = 0; i < 4; ++i) world.step({{2.0, 2.0}, {}});
  EXPECT_DOUBLE_EQ(world.twist(0).forward_mps, 0.5);
}

TEST(World, CollisionIsReportedAndStopsRobot) {
  World world(
      arena("obstacles:\n  - {kind: box, pose: [0.6, 0.33, 0.5], size_m: [0.2, 0.2], height_m: 0.2}\n"),
      exact(), 1);
  int contacts = 0;
  for (int i = 0; i < 40; ++i) contacts += static_cast<int>(world.step({{0.2, 0.2}, {}}).collisions.size());
  EXPECT_GT(contacts, 5);
  // The face of the box is 0.1 m before its centre, in line with the robot. The robot stops with its rim
  // there.
  const double way_m = world.now().map_from_bases[0].translation().norm();
  EXPECT_NEAR(way_m, Eigen::Vector2d(0.6, 0.33).norm() - 0.1 - 0.15, 0.005);
  // Reversing is not blocked.
  world.step({{-0.2, -0.2}, {}});
  EXPECT_LT(world.now().map_from_bases[0].translation().norm(), way_m - 0.03);
}

TEST(World, RobotsDoNotPassThroughEachOther) {
  World world(arena(), exact(), 1);
  world.step({{-0.1, 0.1}, {}});
  bool met = false;
  for (int i = 0; i < 99; ++i) {
    const double off = wrapAngle(0.5 * M_PI - world.now().map_from_bases[0].theta_rad);
    const World::Driven& driven = world.step({{0.25 - 0.2 * off, 0.25 + 0.2 * off}, {}});
    for (const World::Collision& collision : driven.collisions) met = met || collision.with == "r2";
  }
  EXPECT_TRUE(met);
  EXPECT_TRUE(world.finished());
  const auto& poses = world.now().map_from_bases;
  EXPECT_GT((poses[0].translation() - poses[1].translation()).norm(), 0.29);
}

TEST(World, RejectsWrongNumberOfCommands) {
  World world(arena(), {}, 1);
  EXPECT_THROW(world.step({{}}), std::runtime_error);
  EXPECT_THROW(World::Options::read(options::Section::parse("noise: 2", "w")), options::Error);
}

}  // namespace
}  // namespace omnifleet::world
