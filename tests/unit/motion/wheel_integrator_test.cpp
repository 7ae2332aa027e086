#include "motion/wheel_integrator.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <cmath>
#include <limits>
#include <random>

namespace omnifleet::motion {
namespace {

constexpr double kSeparationM = 0.26;
constexpr TimeNs kMs = 1'000'000;

WheelIntegrator::Options quiet() {
  WheelIntegrator::Options options;
  options.noise = 0.0;
  options.noise_floor_mps = 1e-6;
  options.side_slip = 0.0;
  return options;
}

TEST(WheelIntegrator, HoldsRowSpeedsUntilTheNextRow) {
  WheelIntegrator wheels(kSeparationM, {});
  ASSERT_TRUE(wheels.add(0, 0.2, 0.2));
  ASSERT_TRUE(wheels.add(150 * kMs, 0.4, 0.4));
  EXPECT_FALSE(wheels.motionTo(100 * kMs).valid);  // the first frame has no previous frame
  const Motion motion = wheels.motionTo(300 * kMs);
  ASSERT_TRUE(motion.valid);
  EXPECT_EQ(motion.since_ns, 100 * kMs);
  EXPECT_NEAR(motion.previous_from_current.x_m, 0.05 * 0.2 + 0.15 * 0.4, 1e-12);
  EXPECT_NEAR(motion.left_m, 0.07, 1e-12);
  EXPECT_NEAR(motion.right_m, 0.07, 1e-12);
}

TEST(WheelIntegrator, ComposesFrameMotionsToTheWholePath) {
  WheelIntegrator fine(kSeparationM, {}), coarse(kSeparationM, {});
  std::mt19937 random(7);
  std::uniform_real_distribution<double> speed(-0.3, 0.5);
  for (TimeNs t = 0; t < 4000 * kMs; t += 70 * kMs) {
    const double left = speed(random), right = speed(random);
    fine.add(t, left, right);
    coarse.add(t, left, right);
  }
  fine.motionTo(0);
  coarse.motionTo(0);
  Pose2 pose;
  for (TimeNs t = 130 * kMs; t <= 3900 * kMs; t += 130 * kMs) {
    const Motion motion = fine.motionTo(t);
    ASSERT_TRUE(motion.valid);
    pose = pose * motion.previous_from_current;
  }
  const Pose2 whole = coarse.motionTo(3900 * kMs).previous_from_current;
  EXPECT_LT((pose.vector() - whole.vector()).norm(), 1e-9);
}

TEST(WheelIntegrator, CovarianceMatchesMonteCarloRows) {
  WheelIntegrator::Options options = quiet();
  options.noise = 0.05;
  const double speeds[4][2] = {{0.3, 0.4}, {0.35, 0.2}, {0.4, 0.5}, {0.1, 0.3}};
  const auto run = [&](std::mt19937* random) {
    WheelIntegrator wheels(kSeparationM, options);
    std::normal_distribution<double> noise(0.0, 0.05);
    for (int i = 0; i < 4; ++i) {
      const double left = speeds[i][0] * (random ? 1.0 + noise(*random) : 1.0);
      const double right = speeds[i][1] * (random ? 1.0 + noise(*random) : 1.0);
      wheels.add(i * 200 * kMs, left, right);
    }
    wheels.motionTo(0);
    return wheels.motionTo(800 * kMs);
  };
  const Motion nominal = run(nullptr);
  std::mt19937 random(3);
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  const int samples = 20000;
  for (int i = 0; i < samples; ++i) {
    const Pose2 off = nominal.previous_from_current.inverse() * run(&random).previous_from_current;
    sampled += off.vector() * off.vector().transpose() / samples;
  }
  // 20 000 samples determine a variance to 1 % (σ √(2/n)); the linearization contributes about as much.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(nominal.covariance(i, i) / sampled(i, i), 1.0, 0.05) << i;
  for (const auto& [a, b] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
    const double scale = std::sqrt(sampled(a, a) * sampled(b, b));
    EXPECT_NEAR(nominal.covariance(a, b) / scale, sampled(a, b) / scale, 0.03) << a << b;
  }
}

TEST(WheelIntegrator, AccumulatesScaleErrorsOverRows) {
  WheelIntegrator::Options options = quiet();
  options.scale_sigma = 0.02;
  WheelIntegrator wheels(kSeparationM, options);
  for (int i = 0; i < 5; ++i) wheels.add(i * 200 * kMs, 0.5, 0.5);
  wheels.motionTo(0);
  const Motion motion = wheels.motionTo(1000 * kMs);
  // 0.5 m straight on, with a constant scale error of 2 % per wheel: σ_x = 0.5·0.02/√2, σ_θ = √2·0.01/L.
  EXPECT_NEAR(std::sqrt(motion.covariance(0, 0)), 0.01 / std::sqrt(2.0), 1e-5);
  EXPECT_NEAR(std::sqrt(motion.covariance(2, 2)), std::sqrt(2.0) * 0.01 / kSeparationM, 1e-4);
}

TEST(WheelIntegrator, KeepsCovariancePositiveDefinite) {
  WheelIntegrator wheels(kSeparationM, {});
  wheels.add(0, 0.0, 0.0);
  wheels.motionTo(0);
  const Motion still = wheels.motionTo(200 * kMs);
  ASSERT_TRUE(still.valid);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(still.covariance).eigenvalues().minCoeff(), 0.0);
}

TEST(WheelIntegrator, InflatesLateRowsThenRejectsThem) {
  WheelIntegrator wheels(kSeparationM, {});
  wheels.add(0, 0.3, 0.3);
  wheels.motionTo(0);
  const Motion fresh = wheels.motionTo(200 * kMs);
  const Motion late = wheels.motionTo(800 * kMs);
  ASSERT_TRUE(fresh.valid);
  ASSERT_TRUE(late.valid);
  EXPECT_GT(late.covariance(0, 0), 20.0 * fresh.covariance(0, 0));
  EXPECT_FALSE(wheels.motionTo(1300 * kMs).valid);
  wheels.add(1300 * kMs, 0.3, 0.3);
  EXPECT_TRUE(wheels.motionTo(1500 * kMs).valid);
}

TEST(WheelIntegrator, IsInvalidBeforeFirstRowAndWithoutWheels) {
  WheelIntegrator wheels(kSeparationM, {});
  wheels.motionTo(0);
  wheels.add(100 * kMs, 0.3, 0.3);
  EXPECT_FALSE(wheels.motionTo(200 * kMs).valid);  // half of the interval has no row
  EXPECT_TRUE(wheels.motionTo(300 * kMs).valid);
  WheelIntegrator none;
  none.motionTo(0);
  none.add(0, 1.0, 1.0);
  EXPECT_FALSE(none.motionTo(200 * kMs).valid);
}

TEST(WheelIntegrator, IgnoresInvalidRowsAndFrames) {
  WheelIntegrator wheels(kSeparationM, {});
  EXPECT_TRUE(wheels.add(0, 0.3, 0.3));
  EXPECT_FALSE(wheels.add(100 * kMs, std::numeric_limits<double>::quiet_NaN(), 0.3));
  EXPECT_FALSE(wheels.add(100 * kMs, 0.3, std::numeric_limits<double>::infinity()));
  EXPECT_FALSE(wheels.add(0, 0.5, 0.5));
  wheels.motionTo(0);
  EXPECT_TRUE(wheels.motionTo(200 * kMs).valid);
  EXPECT_FALSE(wheels.motionTo(150 * kMs).valid);  // a frame out of order has no effect
  const Motion next = wheels.motionTo(400 * kMs);
  EXPECT_TRUE(next.valid);
  EXPECT_EQ(next.since_ns, 200 * kMs);
  wheels.restart();
  EXPECT_FALSE(wheels.motionTo(600 * kMs).valid);
  EXPECT_THROW(WheelIntegrator(0.0, {}), std::runtime_error);
}

TEST(WheelIntegrator, RejectsInvalidOptions) {
  const auto read = [](const std::string& text) {
    return WheelIntegrator::Options::read(options::Section::parse(text, "test"));
  };
  EXPECT_EQ(read("integration: euler").integration, Integration::kEuler);
  EXPECT_THROW(read("integration: spline"), options::Error);
  EXPECT_THROW(read("noise: -1"), options::Error);
  EXPECT_THROW(read("nois: 0.1"), options::Error);
}

}  // namespace
}  // namespace omnifleet::motion
