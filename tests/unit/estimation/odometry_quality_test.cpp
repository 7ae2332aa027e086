// Scan matches separate two errors of wheels: jitter of the single frames (another clock) and independent
// errors of the steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "estimation/factors.h"
#include "estimation/fleet_state.h"
#include "estimation/scan_source.h"
#include "estimation/troubles.h"
#include "estimation/uncertainty.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

constexpr double kStated_m = 0.002, kStated_rad = 0.004;  // σ of a step, as the wheels state it
constexpr TimeNs kPeriod_ns = 100000000;

/// Errors of the wheels: σ of the jitter of each frame, and σ of each step in units of the stated σ.
struct WheelErrors {
  double jitter_m = 0.0, jitter_rad = 0.0;
  double way_scale = 1.0, turn_scale = 1.0;
};

/// Means of what is learnt, over the frames after the first 40.
struct LearntQuality {
  double jitter_m = 0.0, jitter_rad = 0.0, way_scale = 0.0, turn_scale = 0.0;
  double worst_m = 0.0;
};

/// One robot with a laser drives circles in the furnished room, with the steps of the estimator but without
/// objects.
class OdometryWithScans {
 public:
  explicit OdometryWithScans(unsigned seed)
      : random_(seed), source_(options_.scan, options_.match), fleet_({setup()}, options_) {}

  LearntQuality drive(const WheelErrors& errors, int frames = 110) {
    LearntQuality mean;
    constexpr int kFrom = 40;
    for (int i = 0; i < frames; ++i) {
      process(i, errors);
      const Pose2 off = at_.inverse() * fleet_.pose(robot().window.back().pose);
      mean.worst_m = std::max(mean.worst_m, off.translation().norm());
      if (i < kFrom) continue;
      const double share = 1.0 / (frames - kFrom);
      const OdometryQuality& learnt = robot().scan_aid.odometry;
      mean.jitter_m += share * learnt.jitterM();
      mean.jitter_rad += share * learnt.jitterRad();
      mean.way_scale += share * learnt.wayScale();
      mean.turn_scale += share * learnt.turnScale();
    }
    return mean;
  }

 private:
  static RobotSetup setup() {
    RobotSetup robot;
    robot.name = "r1";
    robot.initial_pose = Pose2{0.2, -1.2, 0.0};
    return robot;
  }
  RobotNode& robot() { return fleet_.robots.front(); }

  Pose2 drawn(double m, double rad) {
    std::normal_distribution<double> normal(0.0, 1.0);
    const double x = m * normal(random_), y = m * normal(random_);
    return {x, y, rad * normal(random_)};
  }

  Objects frameOf(int i, const WheelErrors& errors) {
    Objects frame;
    frame.robot = "r1";
    frame.acquired_ns = (i + 1) * kPeriod_ns;
    const Pose2 moved = i > 0 ? Pose2{0.06, 0.0, 0.08} : Pose2{};
    at_ = at_ * moved;
    frame.boundary = scan::testing::furnishedRoom().scan(at_, 0.003, random_, 360);
    frame.motion.since_ns = frame.acquired_ns - kPeriod_ns;
    frame.motion.valid = i > 0;
    const Pose2 jitter = drawn(errors.jitter_m, errors.jitter_rad);
    frame.motion.previous_from_current = jitter_.inverse() * moved * jitter *
                                         drawn(errors.way_scale * kStated_m, errors.turn_scale * kStated_rad);
    frame.motion.covariance = Eigen::Vector3d(kStated_m, kStated_m, kStated_rad).cwiseAbs2().asDiagonal();
    jitter_ = jitter;
    return frame;
  }

  void process(int i, const WheelErrors& errors) {
    const Objects objects = frameOf(i, errors);
    if (i == 0) {
      fleet_.place(robot(), objects, at_);
      robot().covariance = 1e-6 * Eigen::Matrix3d::Identity();
      fleet_.graph.addFactor(absolutePoseFactor(at_, robot().covariance), {robot().window.back().pose});
    } else {
      fleet_.advance(robot(), objects);
    }
    robot().started = robot().unrefined = true;
    RobotFrame frame{&objects, &robot(), true, {}};
    source_.observe(fleet_, frame);
    fleet_.graph.solve(fleet_.options.solver_iterations);
    updateUncertainty(fleet_, true, false);
    source_.keep(fleet_);
    fleet_.slide();
    robot().unrefined = false;
  }

  std::mt19937 random_;
  EstimatorOptions options_;
  ScanSource source_;
  FleetState fleet_;
  Pose2 at_{0.2, -1.2, 0.0}, jitter_;
};

TEST(OdometryQuality, IsConfirmedByCertainAndPlausibleMatchesOnly) {
  OdometryQualityOptions options;
  OdometryQuality sharp(options), vague(options), wrong(options);
  const Eigen::Matrix3d claimed = 1e-4 * Eigen::Matrix3d::Identity(),
                        match = 1e-6 * Eigen::Matrix3d::Identity(),
                        loose = 1e-2 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3 * static_cast<int>(options.prior_steps); ++i) {
    EXPECT_EQ(sharp.isConfirmed(), i > static_cast<int>(options.prior_steps)) << i;
    sharp.add({0.001, 0.0, 0.001}, match, claimed, 0.1);
    vague.add({0.001, 0.0, 0.001}, loose, claimed, 0.1);
    wrong.add({1.0, 0.0, 1.0}, match, claimed, 0.1);
  }
  EXPECT_FALSE(vague.isConfirmed()) << "a corridor does not determine turns";
  EXPECT_FALSE(wrong.isConfirmed()) << "too large for noise";
}

TEST(OdometryQuality, LearnsNoExcessErrorOfConsistentOdometry) {
  const LearntQuality learnt = OdometryWithScans(1).drive({});
  EXPECT_LT(learnt.turn_scale, 1.3);
  EXPECT_LT(learnt.way_scale, 1.3);
  // The standard error of a mean over 30 steps counts as jitter: σ/30^¼ = 0.43 σ.
  EXPECT_LT(learnt.jitter_rad, 0.6 * kStated_rad);
  EXPECT_LT(learnt.jitter_m, 0.6 * kStated_m);
  EXPECT_LT(learnt.worst_m, 0.01);
}

TEST(OdometryQuality, LearnsHeadingJitterOfFrames) {
  for (const double jitter_rad : {0.01, 0.02}) {
    const LearntQuality learnt = OdometryWithScans(2).drive({0.0, jitter_rad});
    EXPECT_GT(learnt.jitter_rad, jitter_rad / 1.6);
    EXPECT_LT(learnt.jitter_rad, jitter_rad * 1.6);
    EXPECT_LT(learnt.jitter_m, kStated_m) << "positions agree with the wheels";
    EXPECT_LT(learnt.way_scale, 1.3);
    // Independent errors of this size would be √(1 + 2·jitter²/σ²): 3.7 and 7.1. What the prior of kPrior
    // steps without jitter leaves counts as such errors.
    EXPECT_LT(learnt.turn_scale, 0.45 * std::hypot(1.0, std::sqrt(2.0) * jitter_rad / kStated_rad));
    EXPECT_LT(learnt.worst_m, 0.01);
  }
}

TEST(OdometryQuality, LearnsPositionJitterOfFrames) {
  const LearntQuality learnt = OdometryWithScans(3).drive({0.01, 0.0});
  EXPECT_GT(learnt.jitter_m, 0.01 / 1.6);
  EXPECT_LT(learnt.jitter_m, 0.01 * 1.6);
  EXPECT_LT(learnt.jitter_rad, kStated_rad);
  EXPECT_LT(learnt.turn_scale, 1.3);
}

TEST(OdometryQuality, LearnsThatTurnsExceedTheirStatedSigma) {
  const LearntQuality learnt = OdometryWithScans(4).drive({0.0, 0.0, 1.0, 5.0});
  EXPECT_GT(learnt.turn_scale, 2.0);
  EXPECT_LT(learnt.turn_scale, 6.0);
  // Jitter of this size would be 5·σ/√2 = 0.014 rad.
  EXPECT_LT(learnt.jitter_rad, 0.8 * 5.0 * kStated_rad / std::sqrt(2.0));
  EXPECT_LT(learnt.way_scale, 1.3);
  EXPECT_LT(learnt.worst_m, 0.01);
}

TEST(OdometryQuality, LearnsThatTranslationsExceedTheirStatedSigma) {
  const LearntQuality learnt = OdometryWithScans(5).drive({0.0, 0.0, 5.0, 1.0});
  EXPECT_GT(learnt.way_scale, 2.0);
  EXPECT_LT(learnt.way_scale, 6.0);
  EXPECT_LT(learnt.turn_scale, 1.3);
}

}  // namespace
}  // namespace omnifleet::estimation
