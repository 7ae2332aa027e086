#include "localizer/marked_robots.h"

#include <gtest/gtest.h>

namespace omnifleet::localizer {
namespace {

Measurement poseOf(const std::string& robot, TimeNs time_ns) {
  Measurement m;
  m.source = "ceiling/c1";
  m.to = robot;
  m.acquired_ns = time_ns;
  return m;
}

TEST(MarkedRobots, HaveOneFramePerTimeAtWhichACameraDetectsThem) {
  MarkedRobots robots({"r3", "r4"}, {});
  const Measurement r1 = poseOf("r1", 5), r3 = poseOf("r3", 5), again = poseOf("r3", 5), old = poseOf("r4", 4);
  const auto& frames = robots.framesAt(5, {&r1, &r3, &again, &old});
  ASSERT_EQ(frames.size(), 1u) << "r1 has a camera, two cameras see r3, the pose of r4 is of another time";
  EXPECT_EQ(frames[0].robot, "r3");
  EXPECT_EQ(frames[0].acquired_ns, 5);
  EXPECT_FALSE(frames[0].motion.valid);
  const Measurement later = poseOf("r3", 6);
  EXPECT_EQ(robots.framesAt(6, {&later})[0].sequence, 1u);
}

TEST(MarkedRobots, EnterTheMapWhenTheyMoveAndOncePerSecond) {
  MarkedRobots robots({"r3"}, {});
  PoseEstimate pose;
  pose.robot = "r3";
  EXPECT_FALSE(robots.isDue(pose)) << "not valid";
  pose.valid = true;
  EXPECT_TRUE(robots.isDue(pose));
  pose.acquired_ns = 200'000'000;
  pose.map_from_base.x_m = 0.002;
  EXPECT_FALSE(robots.isDue(pose));
  pose.map_from_base.x_m = 0.006;
  EXPECT_TRUE(robots.isDue(pose));
  pose.acquired_ns = 1'300'000'000;
  EXPECT_TRUE(robots.isDue(pose));
}

}  // namespace
}  // namespace omnifleet::localizer
