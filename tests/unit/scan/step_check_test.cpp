// Two consecutive scans of a furnished room against motions that are right or wrong by a known amount.
#include "scan/step_check.h"

#include <gtest/gtest.h>

#include <cmath>

#include "room_scans.h"

namespace omnifleet::scan {
namespace {

using Verdict = StepCheck::Verdict;

constexpr double kStepScanSigma = 0.003;  // 1/m
constexpr std::int64_t kBefore_ns = 1'000'000'000;

Eigen::Matrix3d motionCovariance(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

/// A robot that has driven `moved` between two scans. Its laser stands before base_link's origin.
struct StepInRoom {
  Pose2 moved{0.15, 0.05, 0.3};
  Boundary before, now;

  explicit StepInRoom(unsigned seed, const Eigen::Vector2d& laser_m = {0.3, -0.1}) {
    std::mt19937 random(seed);
    const Pose2 at{-0.3, 0.1, 0.4}, mount{laser_m.x(), laser_m.y(), 0.0};
    const testing::Scene room = testing::furnishedRoom();
    before = room.scan(at * mount, kStepScanSigma, random);
    now = room.scan(at * moved * mount, kStepScanSigma, random);
    before.origin_m = now.origin_m = laser_m;
  }

  StepCheck remembered() const {
    StepCheck check;
    check.remember(kBefore_ns, before);
    return check;
  }
};

TEST(StepCheck, AgreesWithTheTrueMotion) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const StepInRoom step(seed);
    StepCheck check = step.remembered();
    EXPECT_EQ(check.judge(kBefore_ns, step.moved, motionCovariance(0.005, 0.005), step.now), Verdict::kAgrees)
        << seed;
  }
}

TEST(StepCheck, DiffersFromAMotionFarOutsideItsCovariance) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const StepInRoom step(seed);
    StepCheck check = step.remembered();
    for (const Pose2& off : {Pose2{0.2, 0.0, 0.0}, Pose2{0.0, -0.2, 0.0}, Pose2{0.0, 0.0, 0.2}}) {
      // 0.2 is 18 times the σ of the motion (0.005) and of its least error (0.01) together.
      EXPECT_EQ(check.judge(kBefore_ns, step.moved * off, motionCovariance(0.005, 0.005), step.now),
                Verdict::kDiffers)
          << seed << ": " << off.vector().transpose();
    }
  }
}

TEST(StepCheck, AllowsThreeSigmasOfTheMotion) {
  const StepInRoom step(1);
  StepCheck check = step.remembered();
  const auto judge = [&](double off_m, double sigma_m) {
    return check.judge(kBefore_ns, step.moved * Pose2{off_m, 0.0, 0.0}, motionCovariance(sigma_m, 0.005),
                       step.now);
  };
  // With the least error of 0.01 m, σ is 0.0224 m: the limit is 0.067 m. Matches are exact to about 3 mm.
  EXPECT_EQ(judge(0.060, 0.02), Verdict::kAgrees);
  EXPECT_EQ(judge(0.075, 0.02), Verdict::kDiffers);
  EXPECT_EQ(judge(0.075, 0.03), Verdict::kAgrees) << "the limit is 0.095 m";
}

TEST(StepCheck, SaysNothingWithoutTheScanOfTheFrameBefore) {
  const StepInRoom step(1);
  const Eigen::Matrix3d covariance = motionCovariance(0.005, 0.005);
  StepCheck check;
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, step.now), Verdict::kNothing);
  EXPECT_EQ(check.judge(0, step.moved, covariance, step.now), Verdict::kNothing) << "nothing is remembered";
  check.remember(kBefore_ns, step.before);
  EXPECT_EQ(check.judge(kBefore_ns - 1, step.moved, covariance, step.now), Verdict::kNothing)
      << "the motion starts from another frame";
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, {}), Verdict::kNothing) << "no boundary now";
  check.remember(kBefore_ns, {});
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, step.now), Verdict::kNothing)
      << "the frame before had no boundary";
}

TEST(StepCheck, SaysNothingAboutScansWithFewLines) {
  const StepInRoom step(1);
  const auto only = [](Boundary boundary, std::size_t beams) {
    for (std::size_t i = beams; i < boundary.sigma.size(); ++i) boundary.inverse_m[i] = boundary.sigma[i] = 0;
    return boundary;
  };
  const Eigen::Matrix3d covariance = motionCovariance(0.005, 0.005);
  StepCheck check = step.remembered();
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, only(step.now, 50)), Verdict::kNothing);
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, only(step.now, 200)), Verdict::kAgrees);
  check.remember(kBefore_ns, only(step.before, 50));
  EXPECT_EQ(check.judge(kBefore_ns, step.moved, covariance, step.now), Verdict::kNothing);
}

TEST(StepCheck, DiffersWhereTheScansShowDifferentPlaces) {
  const StepInRoom step(1);
  StepCheck check = step.remembered();
  std::mt19937 random(2);
  const testing::Scene elsewhere{{{{-0.5, -0.4}, {0.5, -0.4}, {0.5, 0.4}, {-0.5, 0.4}}}};
  EXPECT_EQ(
      check.judge(kBefore_ns, {}, motionCovariance(0.5, 0.5), elsewhere.scan({}, kStepScanSigma, random)),
      Verdict::kDiffers);
}

}  // namespace
}  // namespace omnifleet::scan
