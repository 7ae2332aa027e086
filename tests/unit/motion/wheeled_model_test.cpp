#include "motion/wheeled_model.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kSeparationM = 0.26;

TEST(WheeledModel, ImplementsEquation1) {
  const Twist twist = twistFromWheels({0.2, 0.3}, kSeparationM);
  EXPECT_DOUBLE_EQ(twist.forward_mps, 0.25);
  EXPECT_DOUBLE_EQ(twist.turn_radps, 0.1 / kSeparationM);
  const WheelSpeeds back = wheelsFromTwist(twist, kSeparationM);
  EXPECT_NEAR(back.left_mps, 0.2, 1e-15);
  EXPECT_NEAR(back.right_mps, 0.3, 1e-15);
}

TEST(WheeledModel, IntegratesStraightMotionAndTurnOnTheSpot) {
  const Pose2 straight = rolled(0.5, 0.5, kSeparationM, Integration::kArc);
  EXPECT_EQ(straight.vector(), Eigen::Vector3d(0.5, 0.0, 0.0));
  const double quarter_m = 0.5 * M_PI * 0.5 * kSeparationM;
  const Pose2 turn = rolled(-quarter_m, quarter_m, kSeparationM, Integration::kArc);
  EXPECT_NEAR(turn.theta_rad, 0.5 * M_PI, 1e-12);
  EXPECT_NEAR(turn.translation().norm(), 0.0, 1e-15);
}

TEST(WheeledModel, IntegratesAQuarterCircleExactly) {
  // A quarter circle of radius R about a centre on the left: the end is (R, R), turned by 90°.
  const double radius_m = 0.8, angle_rad = 0.5 * M_PI;
  const Pose2 end = rolled((radius_m - 0.5 * kSeparationM) * angle_rad,
                           (radius_m + 0.5 * kSeparationM) * angle_rad, kSeparationM, Integration::kArc);
  EXPECT_NEAR(end.x_m, radius_m, 1e-12);
  EXPECT_NEAR(end.y_m, radius_m, 1e-12);
  EXPECT_NEAR(end.theta_rad, angle_rad, 1e-12);
}

TEST(WheeledModel, ConvergesToTheArcFromEulerSteps) {
  const Pose2 exact = rolled(0.3, 0.5, kSeparationM, Integration::kArc);
  double error_before = 0.0;
  for (const int steps : {100, 200}) {
    Pose2 pose;
    for (int i = 0; i < steps; ++i)
      pose = pose * rolled(0.3 / steps, 0.5 / steps, kSeparationM, Integration::kEuler);
    const double error = (pose.translation() - exact.translation()).norm();
    EXPECT_LT(error, 2e-3);
    // The error of Euler steps halves with the step size (first order).
    if (steps == 200) {
      EXPECT_NEAR(error / error_before, 0.5, 0.01);
    }
    error_before = error;
  }
}

TEST(WheeledModel, IsContinuousAtSmallAngles) {
  // Both branches of the chord formula agree where they meet (angle 2e-4).
  const double eps = 1e-9, angle_m = 2e-4 * kSeparationM;
  const Pose2 below = rolled(1.0, 1.0 + angle_m - eps, kSeparationM, Integration::kArc);
  const Pose2 above = rolled(1.0, 1.0 + angle_m + eps, kSeparationM, Integration::kArc);
  // They differ only by the 2·eps of the inputs. The bound is four times that, over the separation.
  EXPECT_LT((above.vector() - below.vector()).norm(), 4.0 * 2.0 * eps / kSeparationM);
}

TEST(WheeledModel, KeepsCurvatureWhenLimited) {
  const WheelSpeeds fast = limited({0.6, -1.2}, 0.4);
  EXPECT_DOUBLE_EQ(fast.right_mps, -0.4);
  EXPECT_DOUBLE_EQ(fast.left_mps / fast.right_mps, 0.6 / -1.2);
  EXPECT_DOUBLE_EQ(limited({0.1, 0.2}, 0.4).right_mps, 0.2);
}

}  // namespace
}  // namespace omnifleet::motion
