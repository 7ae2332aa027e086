#include "estimation/wheel_log.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSeparation_m = 0.3;
constexpr TimeNs kRow_ns = 20'000'000;

TimeNs at(double seconds) {
  return static_cast<TimeNs>(std::llround(seconds * 1e9));
}

/// Constant speeds from 0 to 10 s.
WheelLog driven(double left_mps, double right_mps, const WheelLogOptions& options = {}) {
  WheelLog log(options);
  for (int i = 0; i <= 500; ++i) EXPECT_TRUE(log.add(i * kRow_ns, left_mps, right_mps));
  return log;
}

WheelLog::Motion moved(const WheelLog& log, double from_s, double to_s,
                       const WheelModel& model = WheelModel::Zero()) {
  WheelLog::Motion motion;
  EXPECT_TRUE(log.between(at(from_s), at(to_s), kSeparation_m, model, 0.0, motion))
      << from_s << " … " << to_s;
  return motion;
}

/// Closed form: the pose on a circle after t seconds.
Pose2 circle(double left_mps, double right_mps, double t, double separation_m = kSeparation_m) {
  const double v = 0.5 * (left_mps + right_mps), w = (right_mps - left_mps) / separation_m;
  return {v / w * std::sin(w * t), v / w * (1.0 - std::cos(w * t)), wrapAngle(w * t)};
}

void expectNear(const Pose2& got, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(got.x_m, expected.x_m, tolerance);
  EXPECT_NEAR(got.y_m, expected.y_m, tolerance);
  EXPECT_NEAR(wrapAngle(got.theta_rad - expected.theta_rad), 0.0, tolerance);
}

TEST(WheelLog, ConstantSpeedsGiveAnArcBetweenAnyTwoTimes) {
  const WheelLog log = driven(0.1, 0.25);
  for (const auto& [from, to] : {std::pair{0.0, 1.0}, {1.003, 4.5017}, {9.99, 10.7}}) {
    expectNear(moved(log, from, to).previous_from_current, circle(0.1, 0.25, to - from), 1e-9);
  }
}

TEST(WheelLog, ConsecutiveMotionsCompose) {
  WheelLog log({});
  for (int i = 0; i < 100; ++i) log.add(i * kRow_ns, 0.2 + 0.1 * std::sin(0.1 * i), 0.2 - 0.002 * i);
  const Pose2 composed =
      moved(log, 0.101, 0.777).previous_from_current * moved(log, 0.777, 1.5).previous_from_current;
  expectNear(composed, moved(log, 0.101, 1.5).previous_from_current, 1e-12);
}

TEST(WheelLog, ModelScalesWheelsAndTurnsAndShiftsTime) {
  const WheelLog log = driven(0.1, 0.25);
  expectNear(moved(log, 1, 3, {0.04, -0.02, 0, 0, 0}).previous_from_current, circle(0.104, 0.245, 2), 1e-9);
  expectNear(moved(log, 1, 3, {0, 0, 0.1, 0, 0}).previous_from_current,
             circle(0.1, 0.25, 2, kSeparation_m / 1.1), 1e-9);
  WheelLog changing({});
  for (int i = 0; i < 300; ++i) changing.add(i * kRow_ns, 0.001 * i, 0.3 - 0.001 * i);
  expectNear(moved(changing, 2.0, 3.1, {0, 0, 0, 0.4, 0}).previous_from_current,
             moved(changing, 1.6, 2.7).previous_from_current, 1e-12);
}

// An axle that is not perpendicular to the x axis of base_link: the same arc in a turned frame.
TEST(WheelLog, AxleMisalignmentTurnsTheTranslationNotTheHeading) {
  const WheelLog log = driven(0.1, 0.25);
  const double crab = 0.05;
  const Pose2 turned = Pose2{0, 0, crab} * circle(0.1, 0.25, 2) * Pose2{0, 0, -crab};
  expectNear(moved(log, 1, 3, {0, 0, 0, 0, crab}).previous_from_current, turned, 1e-9);
}

TEST(WheelLog, DerivativesAgreeWithThoseOfAnArc) {
  const WheelLog log = driven(0.1, 0.25);
  const WheelJacobian got = moved(log, 1, 3).jacobian;
  EXPECT_TRUE(got.leftCols<2>().isApprox(arcBiasJacobian(0.2, 0.5, kSeparation_m), 1e-5)) << got;
  // At constant speeds a delay has no effect. A relative error ε of turns changes the heading by ε·ω·t.
  EXPECT_LT(got.col(3).norm(), 1e-9);
  EXPECT_NEAR(got(2, 2), 0.5 * 2.0, 1e-6);
}

TEST(WheelLog, CovarianceOfAStraightPathFollowsTheRandomWalks) {
  WheelLogOptions options;
  const Eigen::Matrix3d covariance = moved(driven(0.2, 0.2, options), 0, 4).covariance;
  const double t = 4.0, travel_m = 0.2 * t;
  EXPECT_NEAR(covariance(0, 0), options.way_walk * options.way_walk * t, 1e-9);
  EXPECT_NEAR(covariance(2, 2), options.turn_walk * options.turn_walk * t, 1e-9);
  // The random walk of the heading moves the end sideways: ∫(v·s)²q ds = q·travel²·t/3. Rows of 20 ms in 4 s
  // give 1 %.
  const double side =
      options.side_walk * options.side_walk * t + covariance(2, 2) * travel_m * travel_m / 3.0;
  EXPECT_NEAR(covariance(1, 1), side, 0.01 * side);
  EXPECT_NEAR(covariance(1, 2), 0.5 * travel_m * covariance(2, 2), 0.01 * travel_m * covariance(2, 2));
}

TEST(WheelLog, StationaryRobotHasNoMotionAndNoCovariance) {
  const WheelLog::Motion motion = moved(driven(0, 0), 0, 4);
  expectNear(motion.previous_from_current, {}, 1e-15);
  EXPECT_EQ(motion.covariance.norm(), 0.0);
}

TEST(WheelLog, TurningIsLessCertainThanDrivingStraight) {
  EXPECT_GT(moved(driven(-0.2, 0.2), 0, 1).covariance(2, 2),
            4.0 * moved(driven(0.2, 0.2), 0, 1).covariance(2, 2));
}

TEST(WheelLog, GivesNoMotionOutsideRowsAndAcrossGaps) {
  WheelLog log({});
  WheelLog::Motion motion;
  EXPECT_FALSE(log.between(0, 1, kSeparation_m, WheelModel::Zero(), 0.0, motion));
  log.add(at(1), 0.1, 0.1);
  log.add(at(2), 0.1, 0.1);
  log.add(at(5), 0.1, 0.1);  // a gap longer than the validity of a row (2 s)
  const auto hasMotion = [&](double from, double to) {
    return log.between(at(from), at(to), kSeparation_m, WheelModel::Zero(), 0.0, motion);
  };
  EXPECT_FALSE(hasMotion(0.9, 1.5));
  EXPECT_TRUE(hasMotion(1.0, 2.0));
  EXPECT_TRUE(hasMotion(1.0, 3.9));
  EXPECT_FALSE(hasMotion(1.0, 4.5));
  EXPECT_FALSE(hasMotion(2.5, 6.0));
  EXPECT_TRUE(hasMotion(5.0, 6.9));
  EXPECT_FALSE(hasMotion(5.0, 7.1));
  EXPECT_FALSE(hasMotion(2.0, 2.0));
  EXPECT_FALSE(log.between(at(1), at(2), 0.0, WheelModel::Zero(), 0.0, motion));
}

TEST(WheelLog, RejectsNonFiniteSpeedsAndNonIncreasingTimes) {
  WheelLog log({});
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(log.add(0, kNan, 0.1));
  EXPECT_FALSE(log.add(0, 0.1, std::numeric_limits<double>::infinity()));
  EXPECT_TRUE(log.empty());
  EXPECT_TRUE(log.add(10, 0.1, 0.1));
  EXPECT_FALSE(log.add(10, 0.2, 0.2));
  EXPECT_FALSE(log.add(9, 0.2, 0.2));
  EXPECT_EQ(log.firstTime(), 10);
}

TEST(WheelLog, ForgetsOldRowsAndKeepsTheRowInForce) {
  WheelLog log = driven(0.1, 0.25);
  const Pose2 before = moved(log, 5.01, 6).previous_from_current;
  log.forgetBefore(at(5.01));
  EXPECT_EQ(log.firstTime(), at(5.0));
  expectNear(moved(log, 5.01, 6).previous_from_current, before, 0.0);
  WheelLog::Motion motion;
  EXPECT_FALSE(log.between(at(4.9), at(6), kSeparation_m, WheelModel::Zero(), 0.0, motion));
}

/// Turns on the spot at 1 rad/s, and stops from 5 s to 6 s.
WheelLog stopping() {
  WheelLog log({});
  for (int i = 0; i <= 500; ++i) {
    const double half_mps = i >= 250 && i < 300 ? 0.0 : 0.5 * kSeparation_m;
    log.add(i * kRow_ns, -half_mps, half_mps);
  }
  return log;
}

// At the stop the motion is not linear in the delay. A linearisation over ±20 ms would extrapolate 1 rad per
// second of delay without limit.
TEST(WheelLog, UncertainDelayAtAStopWidensTheCovariance) {
  const WheelLog log = stopping();
  const auto turnOf = [&](double delay_s) {
    return moved(log, 5.0, 5.3, WheelModel(0, 0, 0, delay_s, 0)).previous_from_current.theta_rad;
  };
  for (const double sigma_s : {0.0, 0.05, 0.3}) {
    WheelLog::Motion motion;
    ASSERT_TRUE(log.between(at(5.0), at(5.3), kSeparation_m, WheelModel::Zero(), sigma_s, motion));
    // Mean, slope and remainder of the turn over delays drawn from their distribution, by quadrature.
    double mean = 0.0, slope = 0.0, square = 0.0, sum = 0.0;
    for (int k = -400; k <= 400 && sigma_s > 0; ++k) {
      const double z = 0.01 * k, w = std::exp(-0.5 * z * z), turn = turnOf(sigma_s * z);
      sum += w, mean += w * turn, slope += w * turn * z, square += w * turn * turn;
    }
    if (sigma_s == 0.0) {
      EXPECT_NEAR(motion.jacobian(2, 3), 0.5, 1e-6)
          << "half of 1 rad/s: it turns on one side of the stop only";
      continue;
    }
    mean /= sum, slope /= sum, square /= sum;
    const double rest = std::sqrt(square - mean * mean - slope * slope);
    // Three points of a kinked curve against the whole curve.
    EXPECT_NEAR(motion.previous_from_current.theta_rad, mean, 0.3 * sigma_s);
    EXPECT_NEAR(motion.jacobian(2, 3), slope / sigma_s, 0.15);
    EXPECT_GT(std::sqrt(motion.covariance(2, 2)), 0.5 * rest);
  }
}

}  // namespace
}  // namespace omnifleet::estimation
