// The guard on the oriented outline, and the law of boundary following.

#include <gtest/gtest.h>

#include <cmath>

#include "motion/boundary_law.h"
#include "motion/motion_guard.h"

namespace omnifleet::motion {
namespace {

const Polygon kBody{{-0.05, -0.055}, {0.08, -0.055}, {0.08, 0.055}, {-0.05, 0.055}};
constexpr double kFrame_s = 0.2;

Pose2 rolledBy(const Twist& twist) {
  return rolled((twist.forward_mps - 0.5 * twist.turn_radps) * kFrame_s,
                (twist.forward_mps + 0.5 * twist.turn_radps) * kFrame_s, 1.0, Integration::kArc);
}

double gap(const Pose2& pose, const std::vector<Eigen::Vector2d>& points_m) {
  double least_m = INFINITY;
  for (const Eigen::Vector2d& point_m : points_m)
    least_m = std::min(least_m, distanceTo(placed(pose, kBody), point_m));
  return least_m;
}

std::vector<Eigen::Vector2d> wall(double x_m) {
  std::vector<Eigen::Vector2d> points_m;
  for (double y_m = -1.0; y_m <= 1.0; y_m += 0.02) points_m.emplace_back(x_m, y_m);
  return points_m;
}

TEST(MotionGuard, StopsBeforeAWallAlthoughTheRobotObeysOneFrameLate) {
  for (double start_m = 0.30; start_m < 0.60; start_m += 0.013) {
    MotionGuard guard({}, kBody);
    const std::vector<Eigen::Vector2d> wall_m = wall(start_m);
    Pose2 pose;
    Twist before, executed;
    double least_m = INFINITY;
    for (int frame = 0; frame < 40; ++frame) {
      Barriers barriers;
      for (const Eigen::Vector2d& point_m : wall_m) barriers.points_m.push_back(pose.inverse() * point_m);
      const Twist wanted{std::min(0.3, before.forward_mps + 0.12), 0.0};
      const Twist now = guard.limit(wanted, before, kFrame_s, barriers).twist;
      executed = before;
      before = now;
      pose = pose * rolledBy(executed);
      least_m = std::min(least_m, gap(pose, wall_m));
    }
    EXPECT_GE(least_m, MotionGuard::Options{}.margin_m - 1e-6) << start_m;
    EXPECT_LT(least_m, 0.12) << start_m << ": it drives up to the wall";
  }
}

TEST(MotionGuard, LetsARectangleTurnOnlyWhereItsCornersPass) {
  MotionGuard guard({}, kBody);
  Barriers beside;
  beside.points_m = {{0.0, 0.088}};  // clear of the side, within the circle of the corners
  EXPECT_FALSE(guard.limit({0.1, 0.0}, {}, kFrame_s, beside).limited);
  Barriers ahead_left;
  ahead_left.points_m = {{0.06, 0.092}};
  const MotionGuard::Result turn = guard.limit({0.0, 1.0}, {}, kFrame_s, ahead_left);
  EXPECT_TRUE(turn.limited);
  EXPECT_FALSE(guard.limit({0.0, -1.0}, {}, kFrame_s, ahead_left).limited) << "away from the point";
}

TEST(MotionGuard, LetsABodyThatIsTooNearLeaveButComeNoNearer) {
  MotionGuard guard({}, kBody);
  Barriers barriers;
  barriers.points_m = {{0.09, 0.0}};
  EXPECT_EQ(guard.limit({0.1, 0.0}, {}, kFrame_s, barriers).twist.forward_mps, 0.0);
  EXPECT_FALSE(guard.limit({-0.1, 0.0}, {}, kFrame_s, barriers).limited);
}

TEST(MotionGuard, AnnouncesWhereTheBodyStandsAfterBraking) {
  MotionGuard guard({}, kBody);
  const MotionGuard::Result result = guard.limit({0.2, 0.0}, {0.2, 0.0}, kFrame_s, {});
  // Two frames at 0.2 m/s and v²/2b.
  EXPECT_NEAR(result.stop.x_m, 0.08 + 0.04, 0.003);
}

Barriers asBarriers(const std::vector<Eigen::Vector2d>& points_m) {
  Barriers barriers;
  barriers.points_m = points_m;
  return barriers;
}

TEST(BoundaryLaw, KeepsAWallAtTheCommandedDistanceOnEitherSide) {
  for (double side : {-1.0, 1.0}) {
    BoundaryLaw::Options options;
    options.right = side < 0.0;
    BoundaryLaw law(options, kBody);
    std::vector<Eigen::Vector2d> beside;
    for (double x_m = -1.0; x_m <= 1.5; x_m += 0.02) beside.emplace_back(x_m, side * 0.3);
    const BoundaryLaw::Result at = law.follow(asBarriers(beside), 0.3);
    EXPECT_TRUE(at.clear && at.follows);
    EXPECT_NEAR(at.distance_m, 0.3, 1e-9);
    EXPECT_NEAR(at.heading_rad, 0.0, 0.1);
    EXPECT_GT(side * law.follow(asBarriers(beside), 0.2).heading_rad, 0.05) << "towards the wall";
    EXPECT_LT(side * law.follow(asBarriers(beside), 0.4).heading_rad, -0.05) << "away from the wall";
  }
}

TEST(BoundaryLaw, GivesNoClearanceSignalBeforeAWallAndTurnsAway) {
  BoundaryLaw law({}, kBody);
  EXPECT_TRUE(law.follow({}, 0.3).clear);
  EXPECT_FALSE(law.follow(asBarriers(wall(0.18)), 0.3).clear);
  EXPECT_TRUE(law.follow(asBarriers(wall(0.30)), 0.3).clear);
  EXPECT_GT(law.follow(asBarriers(wall(0.18)), 0.3).turn, 0.0) << "the boundary is kept on the right";
}

TEST(BoundaryLaw, EntersAnOpeningThatIsNarrowerThanTwiceTheDistance) {
  BoundaryLaw law({}, kBody);
  // A wall on the right ends beside the robot; another begins 0.4 m further.
  std::vector<Eigen::Vector2d> walls;
  for (double x_m = -1.0; x_m <= 0.0; x_m += 0.02) walls.emplace_back(x_m, -0.2);
  for (double x_m = 0.4; x_m <= 1.5; x_m += 0.02) walls.emplace_back(x_m, -0.2);
  const double heading_rad = law.follow(asBarriers(walls), 0.3).heading_rad;
  EXPECT_LT(heading_rad, -0.3);
  EXPECT_GT(heading_rad, -1.3);
}

}  // namespace
}  // namespace omnifleet::motion
