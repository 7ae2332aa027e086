#include "motion/avoidance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::motion {
namespace {

double headingOf(const Eigen::Vector2d& v) {
  return std::atan2(v.y(), v.x());
}

Surroundings wallAhead(double x_m, double from_y_m, double to_y_m) {
  Surroundings around;
  for (double y = from_y_m; y <= to_y_m; y += 0.02) around.points_m.emplace_back(x_m, y);
  return around;
}

TEST(Avoidance, KeepsDesiredVelocityWithoutObstacles) {
  Avoidance avoidance({});
  const auto result = avoidance.steer({}, {0.2, 0.1}, 0.0);
  EXPECT_FALSE(result.turned);
  EXPECT_LT((result.velocity_mps - Eigen::Vector2d(0.2, 0.1)).norm(), 1e-12);
  EXPECT_EQ(avoidance.steer(wallAhead(0.3, -0.2, 0.2), Eigen::Vector2d::Zero(), 0.0).velocity_mps.norm(),
            0.0);
}

TEST(Avoidance, MeasuresFreeDistanceToAPointAndPastIt) {
  Avoidance::Options options;
  options.least_margin_m = 0.0;
  const Avoidance avoidance(options);
  Surroundings around;
  around.radius_m = 0.15;
  around.points_m = {{1.0, 0.0}};
  // Straight towards the point: the centre may come up to radius + margin.
  EXPECT_NEAR(avoidance.freeDistance(around, {1, 0}, 0.2, 0.1, 2.0), 0.75, 1e-12);
  around.points_m = {{1.0, 0.15}};
  EXPECT_NEAR(avoidance.freeDistance(around, {1, 0}, 0.2, 0.1, 2.0), 1.0 - 0.2,
              1e-12);  // 3-4-5: √(0.25² − 0.15²)
  around.points_m = {{1.0, 0.26}, {-0.3, 0.0}};
  EXPECT_EQ(avoidance.freeDistance(around, {1, 0}, 0.2, 0.1, 2.0), 2.0);
}

TEST(Avoidance, TurnsToTheNearerSideAndKeepsIt) {
  Avoidance avoidance({});
  const Surroundings around = wallAhead(0.7, -0.5, 0.2);  // the left end is nearer
  const auto first = avoidance.steer(around, {0.25, 0.0}, 0.0);
  EXPECT_TRUE(first.turned);
  EXPECT_GT(headingOf(first.velocity_mps), 0.2);
  // Now the middle is slightly to the left: without memory of its heading it would turn right.
  const auto second = avoidance.steer(wallAhead(0.7, -0.34, 0.36), {0.25, 0.0}, 0.0);
  EXPECT_GT(headingOf(second.velocity_mps), 0.0);
  Avoidance fresh({});
  EXPECT_LT(headingOf(fresh.steer(wallAhead(0.7, -0.34, 0.36), {0.25, 0.0}, 0.0).velocity_mps), 0.0);
}

TEST(Avoidance, LimitsSpeedToTheBrakingDistance) {
  Avoidance::Options options;
  options.headings = 8;
  Avoidance avoidance(options);
  Surroundings around;  // a closed ring: no heading is free
  for (int i = 0; i < 360; ++i) {
    around.points_m.push_back(0.28 * Eigen::Vector2d(std::cos(i * M_PI / 180), std::sin(i * M_PI / 180)));
  }
  const auto result = avoidance.steer(around, {0.4, 0.0}, 0.0);
  EXPECT_LE(result.velocity_mps.norm(), std::sqrt(2.0 * options.braking_mps2 * result.free_m) + 1e-12);
  EXPECT_LT(result.free_m, 0.05);
}

TEST(Avoidance, LeavesAViolatedMarginButComesNoNearer) {
  Avoidance avoidance({});
  Surroundings around;
  around.radius_m = 0.15;
  around.points_m = {{0.0, 0.20}};  // nearer than any margin, on the left
  EXPECT_GT(avoidance.freeDistance(around, {1, 0}, 0.2, 0.10, 1.0), 0.99);  // along the obstacle
  EXPECT_LT(avoidance.freeDistance(around, {0, 1}, 0.2, 0.10, 1.0), 0.02);  // towards the obstacle
  EXPECT_GT(avoidance.freeDistance(around, {0, -1}, 0.2, 0.10, 1.0), 0.99);
}

TEST(Avoidance, IgnoresRobotAheadAtTheSameVelocity) {
  Avoidance avoidance({});
  Surroundings around;
  around.robots = {{{0.6, 0.0}, {0.25, 0.0}, 0.15}};
  EXPECT_FALSE(avoidance.steer(around, {0.25, 0.0}, 0.0).turned);
  around.robots[0].velocity_mps = {-0.25, 0.0};  // head on
  EXPECT_TRUE(avoidance.steer(around, {0.25, 0.0}, 0.0).turned);
}

TEST(Avoidance, BrakableSpeedKeepsTheLeastMargin) {
  Avoidance::Options options;
  const Avoidance avoidance(options);
  const double step_s = 0.2;
  Surroundings around;
  around.radius_m = 0.15;
  EXPECT_EQ(avoidance.brakableSpeed(around, 0.4, 0.4, step_s), 0.4);
  // 10 cm beyond the body and the least margin, from standstill: v · 0.2 s + v² / (2 · 0.5 m/s²) = 0.1 m.
  around.points_m = {{0.29, 0.0}};
  const double most_mps = avoidance.brakableSpeed(around, 0.4, 0.0, step_s);
  EXPECT_NEAR(most_mps * step_s + most_mps * most_mps, 0.1, 1e-9);
  EXPECT_LT(avoidance.brakableSpeed(around, 0.4, 0.2, step_s), most_mps);
  EXPECT_EQ(avoidance.brakableSpeed(around, 0.4, 0.6, step_s), 0.0);
  EXPECT_EQ(avoidance.brakableSpeed(around, -0.2, 0.0, step_s), -0.2) << "the obstacle is behind";
  around.points_m = {{-0.29, 0.0}};
  EXPECT_NEAR(avoidance.brakableSpeed(around, -0.4, 0.0, step_s), -most_mps, 1e-9);
  around.points_m = {{0.29, 0.2}};
  EXPECT_EQ(avoidance.brakableSpeed(around, 0.4, 0.4, step_s), 0.4) << "the obstacle is beside the path";
}

/// Two robots in line, each command taking effect one step late. Whatever the robot ahead does within its
/// limits, the least margin is kept.
TEST(Avoidance, KeepsLeastMarginWhenRobotAheadBrakes) {
  Avoidance::Options options;
  options.look_ahead_m = 2.0;
  const Avoidance avoidance(options);
  const double step_s = 0.2, wanted_mps = 0.4, apart_m = 0.3 + options.least_margin_m;
  for (const double brakes_from_m : {0.0, 0.5, 1.3}) {
    Surroundings around;
    around.radius_m = 0.15;
    double ahead_m = apart_m + 0.1, ahead_mps = 0.0, here_m = 0.0, speed_mps = 0.0, least_m = ahead_m;
    bool brakes = false;
    for (int i = 0; i < 60; ++i) {
      around.robots = {{{ahead_m - here_m, 0.0}, {ahead_mps, 0.0}, 0.15}};
      // The deceleration per step is bounded.
      const double command_mps =
          std::max(speed_mps - 0.6 * step_s, avoidance.brakableSpeed(around, wanted_mps, speed_mps, step_s));
      brakes = brakes || ahead_m > apart_m + 0.1 + brakes_from_m;
      const double next_mps = brakes ? std::max(0.0, ahead_mps - options.braking_mps2 * step_s)
                                     : std::min(wanted_mps, ahead_mps + 0.6 * step_s);
      ahead_m += 0.5 * (ahead_mps + next_mps) * step_s;
      ahead_mps = next_mps;
      here_m += speed_mps * step_s;
      speed_mps = command_mps;
      least_m = std::min(least_m, ahead_m - here_m);
    }
    EXPECT_GE(least_m, apart_m - 1e-9) << brakes_from_m;
    EXPECT_LT(ahead_m - here_m, apart_m + 0.05) << "the follower must not fall behind";
  }
}

TEST(Surroundings, CollectsRaysAndTracksToAvoid) {
  Objects objects;
  objects.scan.origin_m = {0.1, 0.0};
  objects.scan.range_m = {1.0f, 2.0f, 3.0f, 4.0f};
  objects.scan.sigma_m = {0, 0, 0, 0};
  objects.scan.label = {RayLabel::kObstacle, RayLabel::kFloorEnd, RayLabel::kUnknown, RayLabel::kRobot};
  Track robot;
  robot.kind = ObjectKind::kRobot;
  robot.position_m = {0.0, -4.0};
  Track hidden;
  hidden.kind = ObjectKind::kObstacle;
  hidden.position_m = {5.0, 5.0};
  hidden.covariance = 1e-4 * Eigen::Matrix2d::Identity();
  Track somewhere = hidden;  // not visible and its position unknown: not used for steering
  somewhere.position_m = {-5.0, 5.0};
  somewhere.covariance = Eigen::Matrix2d::Identity();
  objects.tracks = {robot, hidden, somewhere};
  Surroundings around;
  surroundingsFrom(objects, 0.15, 0.2, around);
  ASSERT_EQ(around.robots.size(), 1u);
  EXPECT_EQ(around.robots[0].radius_m, 0.2);
  ASSERT_GE(around.points_m.size(), 3u);
  EXPECT_LT((around.points_m[0] - Eigen::Vector2d(1.1, 0.0)).norm(), 1e-6);
  EXPECT_LT((around.points_m[1] - Eigen::Vector2d(-2.9, 0.0)).norm(), 1e-6);
  EXPECT_EQ(around.points_m[2], hidden.position_m);
  for (const auto& point : around.points_m) EXPECT_GT((point - somewhere.position_m).norm(), 1.0);
}

}  // namespace
}  // namespace omnifleet::motion
