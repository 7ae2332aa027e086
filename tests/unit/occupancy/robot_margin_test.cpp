// Rays that end near another robot.

#include <gtest/gtest.h>

#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {
namespace {

constexpr std::int32_t kFace_dmm = 9000;  // of the other robot, seen from the origin along x

void addPose(OccupancyMap& map, const std::string& robot, std::int32_t x_dmm) {
  KeyframePose pose;
  pose.robot = robot;
  pose.acquired_ns = 0;
  pose.valid = true;
  pose.position = {x_dmm, 0};
  map.add(pose);
}

/// r1 at the origin sees an end of the floor along x. r2 (a square of 0.2 m) stands at x = 1 m.
OccupancyMap seen(std::int32_t range_dmm, std::uint16_t sigma_dmm) {
  OccupancyOptions options;
  options.resolution_m = 0.02;
  RobotBody body;
  body.footprint_m = {{-0.1, -0.1}, {0.1, -0.1}, {0.1, 0.1}, {-0.1, 0.1}};
  OccupancyMap map(options, {{"r1", body}, {"r2", body}});
  Contribution scan;
  scan.robot = "r1";
  scan.acquired_ns = 0;
  scan.range_dmm.assign(360, 0);
  scan.sigma_dmm.assign(360, sigma_dmm);
  scan.label.assign(360, RayLabel::kInvalid);
  scan.object.assign(360, 0);
  scan.range_dmm[0] = range_dmm;
  scan.label[0] = RayLabel::kObstacle;
  map.add(scan);
  addPose(map, "r1", 0);
  addPose(map, "r2", 10000);
  return map;
}

CellClass endOf(std::int32_t range_dmm, std::uint16_t sigma_dmm) {
  return seen(range_dmm, sigma_dmm).at({1e-4 * range_dmm + 1e-4, 1e-3});
}

TEST(RobotMargin, AnObstacleClearlyBeforeARobotIsMapped) {
  EXPECT_EQ(endOf(kFace_dmm - 600, 50), CellClass::kOccupied);
}

// 6 cm before the robot with a σ of 2.5 cm: the ray may have ended at the robot.
TEST(RobotMargin, AnEndThatMayBeTheRobotIsNotMapped) {
  ASSERT_GT(OccupancyOptions{}.free_sigmas * 0.025, 0.06);
  EXPECT_EQ(endOf(kFace_dmm - 600, 250), CellClass::kUnknown);
}

TEST(RobotMargin, TheFloorBeforeSuchAnEndIsFree) {
  const OccupancyMap map = seen(kFace_dmm - 600, 100);
  EXPECT_EQ(map.at({0.5, 1e-3}), CellClass::kFree);
}

TEST(RobotMargin, WhatIsSeenThroughARobotIsNotMapped) {
  EXPECT_EQ(endOf(kFace_dmm + 5000, 10), CellClass::kUnknown);
}

}  // namespace
}  // namespace omnifleet::occupancy
