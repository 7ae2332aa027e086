#include "tracking/own_motion.h"

#include <gtest/gtest.h>

namespace omnifleet::tracking {
namespace {

Motion step(TimeNs since_ns, const Pose2& previous_from_current) {
  Motion motion;
  motion.valid = true;
  motion.since_ns = since_ns;
  motion.previous_from_current = previous_from_current;
  return motion;
}

TEST(OwnMotion, ChainsSteps) {
  OwnMotion own;
  EXPECT_TRUE(own.advance({}, 0));
  const Pose2 turn{0.1, 0.0, M_PI / 2};
  EXPECT_TRUE(own.advance(step(0, turn), 100'000'000));
  EXPECT_TRUE(own.advance(step(100'000'000, turn), 200'000'000));
  const Pose2 expected = turn * turn;
  EXPECT_NEAR(own.odomFromBase().x_m, expected.x_m, 1e-12);
  EXPECT_NEAR(own.odomFromBase().y_m, expected.y_m, 1e-12);
  EXPECT_NEAR(own.odomFromBase().theta_rad, expected.theta_rad, 1e-12);
  EXPECT_DOUBLE_EQ(own.step_s(), 0.1);
  EXPECT_DOUBLE_EQ(own.stepLength(), 0.1);
}

TEST(OwnMotion, InterpolatesItsPath) {
  OwnMotion own;
  own.advance({}, 0);
  own.advance(step(0, {1.0, 0.0, 0.4}), 1'000'000'000);
  const auto middle = own.odomFromBaseAt(500'000'000);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->x_m, 0.5, 1e-12);
  EXPECT_NEAR(middle->theta_rad, 0.2, 1e-12);
  EXPECT_FALSE(own.odomFromBaseAt(-1));
  EXPECT_FALSE(own.odomFromBaseAt(2'000'000'000)) << "the time is in the future";
}

TEST(OwnMotion, ReportsAGapAndClearsThePath) {
  OwnMotion own;
  own.advance({}, 0);
  own.advance(step(0, {1.0, 0.0, 0.0}), 100);
  EXPECT_FALSE(own.advance({}, 200)) << "no motion";
  EXPECT_FALSE(own.odomFromBaseAt(50)) << "nothing may be compared across the gap";
  EXPECT_TRUE(own.advance(step(200, {0.5, 0.0, 0.0}), 100'000'000));
  EXPECT_FALSE(own.advance(step(50'000'000, {0.5, 0.0, 0.0}), 200'000'000))
      << "it begins at an unknown frame";
}

TEST(OwnMotion, AcceptsMotionAcrossAMissedFrame) {
  OwnMotion own;
  own.advance({}, 0);
  own.advance(step(0, {0.1, 0.0, 0.0}), 100'000'000);
  own.advance(step(100'000'000, {0.1, 0.0, 0.0}), 200'000'000);
  EXPECT_TRUE(own.advance(step(100'000'000, {0.3, 0.0, 0.0}), 300'000'000));
  EXPECT_NEAR(own.odomFromBase().x_m, 0.4, 1e-12);
}

TEST(OwnMotion, RejectsMotionOfZeroDuration) {
  OwnMotion own;
  own.advance({}, 100);
  EXPECT_FALSE(own.advance(step(100, {0.1, 0.0, 0.0}), 100));
  EXPECT_DOUBLE_EQ(own.step_s(), 0.0);
}

}  // namespace
}  // namespace omnifleet::tracking
