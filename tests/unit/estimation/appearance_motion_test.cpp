// The visual compass and the distance of signatures as motion of the estimator.
#include "estimation/appearance_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimation/estimator.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kImage_ns = 200000000;

TEST(DifferenceScale, LearnsMetresPerUnit) {
  DifferenceScale scale;
  EXPECT_FALSE(scale.lengthOf(0.1, 0.0));
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.005);
  for (int i = 0; i < 100; ++i) {
    const double difference = 0.1 + 0.001 * i, turn_rad = 0.02 * (i % 7);
    scale.add(0.4 * difference + noise(random), difference, turn_rad);
  }
  ASSERT_TRUE(scale.isMetric());
  const auto length = scale.lengthOf(0.2, 0.05);
  ASSERT_TRUE(length);
  EXPECT_NEAR(length->m, 0.08, 0.003);  // 50 steps of 5 mm noise
  EXPECT_NEAR(length->sigma_m, 0.005, 0.0015);
}

// Turns on the spot change the signatures by 0.03 per 0.1 rad; a step of 5 cm does by 0.1.
TEST(DifferenceScale, KnowsNoLengthAfterTurnsOnTheSpotAlone) {
  DifferenceScale scale;
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.003);
  const auto turn = [&](double rad) { scale.add(0.0005, 0.3 * rad + std::abs(noise(random)), rad); };
  for (int i = 0; i < 20; ++i) turn(0.2 + 0.02 * (i % 5));
  const auto forward = scale.lengthOf(0.1, 0.0);
  ASSERT_TRUE(forward);
  EXPECT_GT(forward->sigma_m, 0.02);
  EXPECT_LT(std::abs(forward->m - 0.05), 3.0 * forward->sigma_m);
  // A turn on the spot is known to have no length.
  const auto spot = scale.lengthOf(0.3 * 0.24, 0.24);
  EXPECT_LT(spot->sigma_m, 0.01);
  EXPECT_LT(spot->m, 0.01);
  // Once it has driven, both are known.
  for (int i = 0; i < 30; ++i) scale.add(0.04 + 0.001 * (i % 20), 2.0 * (0.04 + 0.001 * (i % 20)), 0.0);
  const auto learned = scale.lengthOf(0.1, 0.0);
  EXPECT_NEAR(learned->m, 0.05, 0.01);
  EXPECT_LT(learned->sigma_m, 0.015);
}

TEST(DifferenceScale, HasFreeScaleIfTheOptionIsSet) {
  AppearanceOptions options;
  options.free_scale = true;
  const DifferenceScale scale(options);
  ASSERT_TRUE(scale.lengthOf(0.25, 0.1));
  EXPECT_EQ(scale.lengthOf(0.25, 0.1)->m, 0.25);
  EXPECT_FALSE(scale.isMetric());
}

struct CompassRun {
  bool valid = false;
  double heading_error_rad = 0.0, sigma_rad = 0.0, error_m = 0.0, sigma_m = 0.0;
};

constexpr double kCompassSigma_rad = 0.002;

/// A robot without scans, whose wheels give turns that are too large by a factor, or that has no wheels (0),
/// drives a circle. The compass errs by `noise` times the σ that it gives.
CompassRun driveByCompass(double wheels, bool compass, double confidence, double noise = 1.0) {
  RobotSetup setup;
  setup.name = "r1";
  setup.body.radius_m = 0.1;
  setup.body.wheel_separation_m = 0.2;
  setup.initial_pose = Pose2{};
  EstimatorOptions options;
  options.appearance.with_wheels = true;
  options.appearance.free_scale = wheels == 0;  // the difference of the signatures is in metres here
  FleetEstimator estimator({setup}, options);
  std::mt19937 random(3);
  std::normal_distribution<double> error(0.0, noise * kCompassSigma_rad);
  Pose2 truth;
  CompassRun run;
  for (int i = 0; i < 60; ++i) {
    const Pose2 step{0.05, 0.0, 0.06};
    if (i > 0) truth = truth * step;
    Objects frame;
    frame.robot = "r1";
    frame.acquired_ns = (i + 1) * kImage_ns;
    frame.sequence = static_cast<std::uint32_t>(i);
    frame.motion.since_ns = frame.acquired_ns - kImage_ns;
    frame.motion.valid = wheels > 0 && i > 0;
    if (wheels > 0 && i > 0) {
      frame.motion.previous_from_current = {step.x_m, 0.0, wheels * step.theta_rad};
      frame.motion.covariance = Eigen::Vector3d(1e-5, 1e-5, 4e-5).asDiagonal();
    }
    if (compass && i > 0) {
      frame.appearance.since_ns = frame.motion.since_ns;
      frame.appearance.turn_rad = step.theta_rad + error(random);
      frame.appearance.turn_sigma_rad = kCompassSigma_rad;
      frame.appearance.confidence = static_cast<float>(confidence);
      frame.appearance.difference = 0.05f;
    }
    const auto poses = estimator.process(frame.acquired_ns, {&frame}, {});
    estimator.refine();
    run.heading_error_rad = std::abs(wrapAngle(poses[0].map_from_base.theta_rad - truth.theta_rad));
    run.sigma_rad = std::sqrt(poses[0].covariance(2, 2));
    run.error_m = (poses[0].map_from_base.translation() - truth.translation()).norm();
    run.sigma_m = std::sqrt(poses[0].covariance.topLeftCorner<2, 2>().trace());
    run.valid = poses[0].valid;
  }
  return run;
}

constexpr double kSlipping = 1.1;

TEST(VisualCompass, CorrectsHeadingsOfWheelsThatSlip) {
  const CompassRun without = driveByCompass(kSlipping, false, 0.9),
                   with = driveByCompass(kSlipping, true, 0.9);
  EXPECT_GT(without.heading_error_rad, 0.2);
  EXPECT_LT(with.heading_error_rad, 0.06);  // 59 steps of 2 mrad are 15 mrad; the wheels pull by a tenth
  EXPECT_LT(with.sigma_rad, without.sigma_rad);
}

TEST(VisualCompass, MovesARobotWithoutWheels) {
  const CompassRun with = driveByCompass(0.0, true, 0.9);
  EXPECT_TRUE(with.valid);
  EXPECT_LT(with.heading_error_rad, 3.0 * with.sigma_rad);
  EXPECT_LT(with.heading_error_rad, 0.06);
  EXPECT_LT(with.error_m, 3.0 * with.sigma_m);
  EXPECT_LT(with.error_m, 0.1);                         // of 3 m
  EXPECT_FALSE(driveByCompass(0.0, false, 0.9).valid);  // lost
}

// The wheels turn as they say, with σ of 6 mrad. A compass that errs by 10 mrad instead of 2 helps little.
TEST(VisualCompass, ErrorsThatExceedItsSigmaWidenTheSigmaOfTheHeading) {
  const CompassRun without = driveByCompass(1.0, false, 0.9), consistent = driveByCompass(1.0, true, 0.9),
                   noisy = driveByCompass(1.0, true, 0.9, 5.0);
  EXPECT_LT(consistent.sigma_rad, 0.6 * without.sigma_rad);
  EXPECT_GT(noisy.sigma_rad, 1.5 * consistent.sigma_rad);
  EXPECT_LT(noisy.heading_error_rad, 3.0 * noisy.sigma_rad);
}

/// Errors of a step in σ, of a robot without wheels that turns on the spot before it drives forward.
TEST(VisualCompass, CoversAStepThatFollowsATurnOnTheSpot) {
  RobotSetup setup;
  setup.name = "r1";
  setup.body.radius_m = 0.1;
  setup.initial_pose = Pose2{};
  EstimatorOptions options;
  options.appearance.free_scale = true;
  FleetEstimator estimator({setup}, options);
  Objects frame;
  frame.robot = "r1";
  frame.acquired_ns = kImage_ns;
  estimator.process(frame.acquired_ns, {&frame}, {});
  const double turn_rad = 2.0, way_m = 0.4;
  frame.motion.since_ns = frame.acquired_ns;
  frame.acquired_ns += kImage_ns;
  frame.sequence = 1;
  frame.appearance.since_ns = frame.motion.since_ns;
  frame.appearance.turn_rad = turn_rad;
  frame.appearance.turn_sigma_rad = 0.002;
  frame.appearance.confidence = 0.9f;
  frame.appearance.difference = static_cast<float>(way_m);
  const PoseEstimate pose = estimator.process(frame.acquired_ns, {&frame}, {}).front();
  const Pose2 truth = Pose2{0.0, 0.0, turn_rad} * Pose2{way_m, 0.0, 0.0};
  const Eigen::Vector2d off = Eigen::Rotation2Dd(-pose.map_from_base.theta_rad) *
                              (pose.map_from_base.translation() - truth.translation());
  const Eigen::Matrix2d covariance = pose.covariance.topLeftCorner<2, 2>();
  EXPECT_GT(off.norm(), 0.25);  // the middle between both headings is wrong by a chord
  EXPECT_LT(off.dot(covariance.inverse() * off), 9.0);
  EXPECT_NEAR(pose.map_from_base.theta_rad, turn_rad, 0.01);
}

TEST(VisualCompass, IsNotUsedWhereItsConfidenceIsLow) {
  const CompassRun without = driveByCompass(kSlipping, false, 0.9),
                   low = driveByCompass(kSlipping, true, 0.1);
  EXPECT_EQ(low.heading_error_rad, without.heading_error_rad);
}

}  // namespace
}  // namespace omnifleet::estimation
