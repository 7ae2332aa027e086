#include "world/observer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::world {
namespace {

World someWorld() {
  return World(synthetic::Arena::read(options::Section::parse(R"(
obstacles:
  - {kind: box, pose: [1.0, 0.0, 0.0], size_m: [0.2, 0.4], height_m: 0.2}
  - {kind: cylinder, pose: [0.0, 1.0, 0], radius_m: 0.1, height_m: 0.2}
robots:
  r1: {initial_pose: [0, 0, 1.5707963267948966]}
  r2: {initial_pose: [-1.2, 0, 0]}
  r3: {initial_pose: [-2.0, 0, 0]}
)",
                                                              "arena.yaml")),
               {}, 1);
}

TEST(Observer, MeasuresRangesByGeometry) {
  const World world = someWorld();
  const Objects objects = observe(world, 0);
  ASSERT_EQ(objects.scan.range_m.size(), 360u);
  // The robot faces north: the cylinder is ahead, the box on the right, r2 on the left.
  EXPECT_NEAR(objects.scan.range_m[0], 0.9, 1e-6);
  EXPECT_EQ(objects.scan.label[0], RayLabel::kObstacle);
  EXPECT_NEAR(objects.scan.range_m[270], 0.9, 1e-6);
  EXPECT_NEAR(objects.scan.range_m[275], 0.9 / std::cos(5.0 * M_PI / 180.0), 1e-6);
  EXPECT_NEAR(objects.scan.range_m[90], 1.05, 1e-6);
  EXPECT_EQ(objects.scan.label[90], RayLabel::kRobot);
  EXPECT_EQ(objects.scan.label[180], RayLabel::kFloorEnd);
}

TEST(Observer, TracksOnlyVisibleRobots) {
  World world = someWorld();
  const Objects objects = observe(world, 0);
  ASSERT_EQ(objects.tracks.size(), 1u);  // r3 is hidden behind r2
  EXPECT_EQ(objects.tracks[0].kind, ObjectKind::kRobot);
  EXPECT_LT((objects.tracks[0].position_m - Eigen::Vector2d(0.0, 1.2)).norm(), 1e-9);
  EXPECT_EQ(objects.scan.object[90], objects.tracks[0].id);
  EXPECT_EQ(observe(world, 1).tracks.size(), 2u);
}

TEST(Observer, VelocityIsOverGroundInBaseLink) {
  World world = someWorld();
  for (int i = 0; i < 5; ++i) world.step({{}, {0.2, 0.2}, {}});
  const Track track = observe(world, 0).tracks[0];
  EXPECT_LT((track.velocity_mps - Eigen::Vector2d(0.0, -0.2)).norm(),
            1e-9);  // eastward, in the frame of a robot that faces north
}

TEST(Observer, ExactMotionIsDifferenceOfPoses) {
  const Pose2 before{1, 2, 0.5}, after = before * Pose2{0.1, 0.02, 0.3};
  const Motion motion = exactMotion(before, after, 77);
  EXPECT_TRUE(motion.valid);
  EXPECT_EQ(motion.since_ns, 77);
  EXPECT_LT((motion.previous_from_current.vector() - Eigen::Vector3d(0.1, 0.02, 0.3)).norm(), 1e-12);
}

}  // namespace
}  // namespace omnifleet::world
