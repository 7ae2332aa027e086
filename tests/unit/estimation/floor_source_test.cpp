// Odometry by the texture of the floor: a robot in a furnished room whose scans, wheels and floor are exact
// but for noise. What confirms the floor, what it then replaces, and what it must not move.

#include "estimation/floor_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "estimation/estimator.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kFloorFrame_ns = 200'000'000;
constexpr double kFloorStep_m = 0.06, kFloorTurn_rad = 0.08;
constexpr double kFloorSigma_m = 0.0005, kFloorSigma_rad = 0.0005;

struct FloorRun {
  std::vector<PoseEstimate> poses;
  std::vector<double> errors_m;
  RobotStatus status;
};

/// A circle in the furnished room. @param change modifies the frame of a number
FloorRun runOnFloor(std::size_t frames, bool wheels,
                    const std::function<void(std::size_t, Objects&)>& change = {},
                    const EstimatorOptions& options = {}) {
  RobotSetup setup;
  setup.name = "r1";
  setup.body.radius_m = 0.1;
  setup.body.wheel_separation_m = wheels ? 0.2 : 0.0;
  Pose2 at{0.2, -1.2, 0.0};
  setup.initial_pose = at;
  FleetEstimator estimator({setup}, options);
  const scan::testing::Scene room = scan::testing::furnishedRoom();
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0.0, 1.0);
  FloorRun run;
  for (std::size_t i = 0; i < frames; ++i) {
    const Pose2 step = i > 0 ? Pose2{kFloorStep_m, 0.0, kFloorTurn_rad} : Pose2{};
    at = at * step;
    Objects frame;
    frame.robot = "r1";
    frame.acquired_ns = static_cast<TimeNs>(i + 1) * kFloorFrame_ns;
    frame.sequence = static_cast<std::uint32_t>(i);
    frame.boundary = room.scan(at, 0.003, random);
    FloorMotion& floor = frame.floor_motion;
    floor.valid = i > 0;
    floor.since_ns = frame.acquired_ns - kFloorFrame_ns;
    floor.previous_from_current = step * Pose2{kFloorSigma_m * normal(random), kFloorSigma_m * normal(random),
                                               kFloorSigma_rad * normal(random)};
    floor.covariance = Eigen::Vector3d(kFloorSigma_m * kFloorSigma_m, kFloorSigma_m * kFloorSigma_m,
                                       kFloorSigma_rad * kFloorSigma_rad)
                           .asDiagonal();
    if (wheels) {
      frame.motion.valid = i > 0;
      frame.motion.since_ns = floor.since_ns;
      frame.motion.previous_from_current = step;
      frame.motion.left_m = kFloorStep_m - 0.1 * kFloorTurn_rad;
      frame.motion.right_m = kFloorStep_m + 0.1 * kFloorTurn_rad;
      frame.motion.covariance = Eigen::Vector3d(1e-6, 1e-6, 4e-6).asDiagonal();
    }
    if (change) change(i, frame);
    run.poses.push_back(estimator.process(frame.acquired_ns, {&frame}, {}).front());
    if (estimator.refineDue()) estimator.refine();
    const Pose2 error = run.poses.back().map_from_base.inverse() * at;
    run.errors_m.push_back(error.translation().norm());
  }
  run.status = estimator.status("r1");
  return run;
}

/// From frame 40 on the robot sees nothing but floor.
void blindFrom40(std::size_t i, Objects& frame) {
  if (i >= 40) frame.boundary = {};
}

double sigma_m(const PoseEstimate& pose) {
  return std::sqrt(pose.covariance(0, 0) + pose.covariance(1, 1));
}

// Without wheels a robot that sees no walls for 12 s goes on by its floor: 3.6 m of way.
TEST(FloorSource, KeepsARobotWithoutWheelsThatSeesNothingElse) {
  const FloorRun run = runOnFloor(100, false, blindFrom40);
  for (std::size_t i = 50; i < run.poses.size(); ++i) {
    EXPECT_TRUE(run.poses[i].valid) << i;
    EXPECT_EQ(run.poses[i].state, LocalizationState::kOdometryOnly) << i;
  }
  EXPECT_LT(run.errors_m.back(), 0.05);
  EXPECT_LT(run.errors_m.back(), 3.5 * sigma_m(run.poses.back()));
  EXPECT_GT(sigma_m(run.poses.back()), sigma_m(run.poses[50]));

  EstimatorOptions without;
  without.floor.use = false;
  const FloorRun blind = runOnFloor(100, false, blindFrom40, without);
  EXPECT_EQ(blind.poses.back().state, LocalizationState::kLost);
}

// Nothing has confirmed it: what the floor says may be a reflection, and determines no pose.
TEST(FloorSource, DeterminesNoPoseBeforeItIsConfirmed) {
  const FloorRun run = runOnFloor(60, false, [](std::size_t, Objects& frame) { frame.boundary = {}; });
  EXPECT_GT(sigma_m(run.poses.back()), 0.5);
}

// A floor that stands still while the robot drives, such as a pattern on the lens.
TEST(FloorSource, AFloorThatStandsStillDoesNotMoveTheRobot) {
  const FloorRun run = runOnFloor(120, false, [](std::size_t i, Objects& frame) {
    if (i >= 40) frame.floor_motion.previous_from_current = {};
  });
  // The first wrong step is recognised by the frame after it.
  for (std::size_t i = 0; i < run.poses.size(); ++i) {
    EXPECT_LT(run.errors_m[i], i < 40 || i > 41 ? 0.03 : 2.5 * kFloorStep_m) << i;
    EXPECT_EQ(run.poses[i].state, LocalizationState::kLocalized) << i;
  }
}

// The right wheel spins for two seconds where the robot sees no walls.
TEST(FloorSource, RecognisesSlipOfWheels) {
  const auto slip = [](std::size_t i, Objects& frame) {
    blindFrom40(i, frame);
    if (i < 60 || i >= 70) return;
    frame.motion.right_m += 0.03;
    frame.motion.previous_from_current.theta_rad += 0.15;
    frame.motion.previous_from_current.x_m += 0.015;
  };
  const FloorRun run = runOnFloor(90, true, slip);
  EXPECT_LT(run.errors_m.back(), 0.05);
  EXPECT_GE(run.status.slips, 5);
  EstimatorOptions without;
  without.floor.use = false;
  EXPECT_GT(runOnFloor(90, true, slip, without).errors_m.back(), 0.3);
}

// A wrong floor beside good wheels: scans show which of both is wrong.
TEST(FloorSource, AWrongFloorBesideWheelsCostsLittle) {
  const FloorRun run = runOnFloor(120, true, [](std::size_t i, Objects& frame) {
    if (i >= 40 && i % 3 == 0) frame.floor_motion.previous_from_current = {};
  });
  for (std::size_t i = 0; i < run.errors_m.size(); ++i) {
    EXPECT_LT(run.errors_m[i], i < 40 || i > 50 ? 0.02 : 2.5 * kFloorStep_m) << i;
    EXPECT_EQ(run.poses[i].state, LocalizationState::kLocalized) << i;
  }
}

// One frame without floor motion does not end the odometry of a robot that has seen nothing else for long.
TEST(FloorSource, OneFrameWithoutTextureDoesNotLoseTheRobot) {
  const FloorRun run = runOnFloor(100, false, [](std::size_t i, Objects& frame) {
    blindFrom40(i, frame);
    if (i == 80) frame.floor_motion.valid = false;
  });
  for (std::size_t i = 50; i < run.poses.size(); ++i)
    EXPECT_EQ(run.poses[i].state, LocalizationState::kOdometryOnly) << i;
}

// The floor errs by five times what it claims: the published covariance says so.
TEST(FloorSource, LearnsThatTheFloorClaimsTooMuch) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto noisy = [&](std::size_t i, Objects& frame) {
    if (i >= 100) frame.boundary = {};
    const double m = 5.0 * kFloorSigma_m, rad = 5.0 * kFloorSigma_rad;
    frame.floor_motion.previous_from_current =
        frame.floor_motion.previous_from_current *
        Pose2{m * normal(random), m * normal(random), rad * normal(random)};
  };
  const FloorRun run = runOnFloor(160, false, noisy);
  EXPECT_LT(run.errors_m.back(), 3.5 * sigma_m(run.poses.back()));
  const FloorRun exact = runOnFloor(160, false, [](std::size_t i, Objects& frame) {
    if (i >= 100) frame.boundary = {};
  });
  EXPECT_GT(sigma_m(run.poses.back()), 1.5 * sigma_m(exact.poses.back()));
}

}  // namespace
}  // namespace omnifleet::estimation
