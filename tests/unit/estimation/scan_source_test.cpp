// The estimator of one robot in a furnished room without tracked objects. Only its scans and its wheels,
// which err by 3 %, determine its pose. The scans are exact intersections with noise.

#include "estimation/scan_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "estimation/estimator.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

constexpr double kInverseSigma = 0.003;  // 1/m, of scans
constexpr double kStep_m = 0.06, kTurn_rad = 0.08;
constexpr double kWheelError = 0.03;
constexpr TimeNs kFrame_ns = 200000000;

/// Twice around a circle inside the room, once per 79 frames.
std::vector<Pose2> circularPath(int frames) {
  std::vector<Pose2> path{{0.2, -1.2, 0.0}};
  for (int i = 1; i < frames; ++i) path.push_back(path.back() * Pose2{kStep_m, 0.0, kTurn_rad});
  return path;
}

struct ScanRun {
  std::vector<PoseEstimate> poses;
  std::vector<double> errors_m;
  double worst_m = 0.0, nees = 0.0;
  RobotStatus status;  ///< at the end
  std::size_t count(LocalizationState state) const {
    return static_cast<std::size_t>(
        std::count_if(poses.begin(), poses.end(), [&](const PoseEstimate& p) { return p.state == state; }));
  }
};

/// @param change modifies the frame of a number @param measure absolute pose at that frame
ScanRun runScans(const std::vector<Pose2>& path, const EstimatorOptions& options,
                 const std::function<void(std::size_t, Objects&)>& change = {},
                 const std::function<std::optional<Pose2>(std::size_t)>& measure = {},
                 bool match_scans = true) {
  RobotSetup setup;
  setup.match_scans = match_scans;
  setup.name = "r1";
  setup.body.radius_m = 0.1;
  setup.body.wheel_separation_m = 0.2;
  setup.initial_pose = path.front();
  FleetEstimator estimator({setup}, options);
  const scan::testing::Scene room = scan::testing::furnishedRoom();
  std::mt19937 random(7);
  ScanRun run;
  for (std::size_t i = 0; i < path.size(); ++i) {
    Objects frame;
    frame.robot = "r1";
    frame.acquired_ns = static_cast<TimeNs>(i + 1) * kFrame_ns;
    frame.sequence = static_cast<std::uint32_t>(i);
    frame.boundary = room.scan(path[i], kInverseSigma, random);
    frame.motion.since_ns = frame.acquired_ns - kFrame_ns;
    frame.motion.valid = i > 0;
    if (i > 0) {
      frame.motion.previous_from_current = path[i - 1].inverse() * path[i];
      frame.motion.previous_from_current.x_m *= 1.0 + kWheelError;
      frame.motion.previous_from_current.theta_rad *= 1.0 - kWheelError;
      const double travel_m = 0.02 * frame.motion.previous_from_current.x_m + 0.001, turn_rad = 0.004;
      frame.motion.covariance = Eigen::Vector3d(travel_m * travel_m, 1e-6, turn_rad * turn_rad).asDiagonal();
    }
    if (change) change(i, frame);
    Measurement measurement;
    std::vector<const Measurement*> measurements;
    if (const auto measured = measure ? measure(i) : std::nullopt) {
      measurement.to = "r1";
      measurement.acquired_ns = frame.acquired_ns;
      measurement.value = measured->vector();
      measurement.covariance = 1e-6 * Eigen::Matrix3d::Identity();
      measurements.push_back(&measurement);
    }
    const PoseEstimate pose = estimator.process(frame.acquired_ns, {&frame}, measurements).front();
    if (estimator.refineDue()) estimator.refine();
    const Pose2 error = pose.map_from_base.inverse() * path[i];
    run.errors_m.push_back(error.translation().norm());
    run.worst_m = std::max(run.worst_m, run.errors_m.back());
    const Eigen::Vector3d e = error.vector();
    if (pose.valid) run.nees += e.dot(pose.covariance.ldlt().solve(e)) / static_cast<double>(path.size());
    run.poses.push_back(pose);
  }
  run.status = estimator.status("r1");
  return run;
}

TEST(ScanSource, CorrectsDriftOfOdometry) {
  const std::vector<Pose2> path = circularPath(150);
  EstimatorOptions wheels_only;
  wheels_only.scan.use = false;
  const ScanRun by_wheels = runScans(path, wheels_only), by_scan = runScans(path, {});
  EXPECT_GT(by_wheels.worst_m, 0.05);
  EXPECT_LT(by_scan.worst_m, 0.01);
  EXPECT_LT(by_scan.nees, 6.0);
  EXPECT_EQ(by_scan.count(LocalizationState::kLocalized), path.size());
  for (std::size_t i = 1; i < path.size(); ++i) {
    EXPECT_TRUE(by_scan.poses[i].used.has(Source::kScan)) << i;
    EXPECT_TRUE(by_scan.poses[i].used.has(Source::kWheels)) << i;
    EXPECT_EQ(by_wheels.poses[i].used.bits, static_cast<std::uint16_t>(Source::kWheels)) << i;
  }
}

// A robot with a forward camera. Its ceiling camera fails after 30 frames; then it has odometry only.
TEST(ScanSource, CovarianceGrowsWithoutMatchesOnceMeasurementsEnd) {
  const std::vector<Pose2> path = circularPath(80);
  const auto measure = [&](std::size_t i) { return i < 30 ? std::optional(path[i]) : std::nullopt; };
  const ScanRun run = runScans(path, {}, {}, measure, false);
  for (std::size_t i = 0; i < path.size(); ++i) {
    const PoseEstimate& pose = run.poses[i];
    if (i < 30) {
      EXPECT_TRUE(i == 0 || pose.state == LocalizationState::kLocalized) << i;
      continue;
    }
    const auto variance_m2 = [&](std::size_t k) {
      return run.poses[k].covariance(0, 0) + run.poses[k].covariance(1, 1);
    };
    EXPECT_GT(variance_m2(i), variance_m2(i - 1)) << i;
  }
  EXPECT_EQ(run.poses.back().state, LocalizationState::kOdometryOnly);
}

TEST(ScanSource, TwoRunsAreBitIdentical) {
  const std::vector<Pose2> path = circularPath(60);
  const ScanRun first = runScans(path, {}), second = runScans(path, {});
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_EQ(first.poses[i].map_from_base.vector(), second.poses[i].map_from_base.vector()) << i;
    EXPECT_EQ(first.poses[i].covariance, second.poses[i].covariance) << i;
  }
}

TEST(ScanSource, FiveDarkSecondsGiveOdometryOnlyAndAGrowingCovariance) {
  const std::vector<Pose2> path = circularPath(110);
  constexpr std::size_t kFrom = 40, kTo = 65;
  const ScanRun run = runScans(path, {}, [&](std::size_t i, Objects& frame) {
    if (i < kFrom || i >= kTo) return;
    frame.state = FrameState::kDark;
    frame.boundary = {};
  });
  const auto sigma = [&](std::size_t i) { return run.poses[i].covariance.topLeftCorner<2, 2>().trace(); };
  for (std::size_t i = kFrom; i < kTo; ++i) {
    EXPECT_TRUE(run.poses[i].valid) << i;
    EXPECT_EQ(run.poses[i].used.bits, static_cast<std::uint16_t>(Source::kWheels)) << i;
  }
  EXPECT_EQ(run.poses[kTo - 1].state, LocalizationState::kOdometryOnly);
  EXPECT_GT(sigma(kTo - 1), 1.5 * sigma(kFrom - 1));
  EXPECT_EQ(run.poses[kTo + 3].state, LocalizationState::kLocalized);
  EXPECT_LT(run.errors_m.back(), 0.01);
}

TEST(ScanSource, WheelSlipIsCorrectedWithoutDelay) {
  const std::vector<Pose2> path = circularPath(80);
  const ScanRun run = runScans(path, {}, [](std::size_t i, Objects& frame) {
    if (i >= 40 && i < 50) frame.motion.previous_from_current.x_m *= 1.4;
  });
  EXPECT_LT(run.worst_m, 0.02);
  EXPECT_EQ(run.count(LocalizationState::kLocalized), path.size());
}

TEST(ScanSource, CorrectionBeyondThreeSigmasIsAnEvent) {
  const std::vector<Pose2> path = circularPath(60);
  for (const PoseEstimate& pose : runScans(path, {}).poses) EXPECT_EQ(pose.event, PoseEvent::kNone);
  const ScanRun run = runScans(path, {}, [](std::size_t i, Objects& frame) {
    if (i == 40) frame.motion.previous_from_current.x_m += 0.06;
  });
  EXPECT_EQ(run.poses[39].event, PoseEvent::kNone);
  EXPECT_EQ(run.poses[40].event, PoseEvent::kCorrected);
  EXPECT_GT(run.poses[40].correction_sigmas, 3.0);
  EXPECT_LT(run.errors_m[40], 0.02);
}

TEST(ScanSource, AbsoluteMeasurementConfirmsAPoseThatTheScanContradicts) {
  const std::vector<Pose2> path = circularPath(80);
  const scan::testing::Scene room = scan::testing::furnishedRoom();
  std::mt19937 random(11);
  const auto other_scan = [&](std::size_t i, Objects& frame) {
    if (i >= 40) frame.boundary = room.scan(path[i - 40], kInverseSigma, random);  // half a circle away
  };
  const ScanRun alone = runScans(path, {}, other_scan);
  EXPECT_GT(alone.count(LocalizationState::kOdometryOnly), 5U);
  EXPECT_TRUE(alone.poses[45].rejected.has(Source::kScan));
  EXPECT_FALSE(alone.poses[45].used.has(Source::kScan));
  const ScanRun measured =
      runScans(path, {}, other_scan, [&](std::size_t i) { return std::optional(path[i]); });
  EXPECT_EQ(measured.count(LocalizationState::kLocalized), path.size());
  EXPECT_LT(measured.worst_m, 0.005);  // σ of the measurements: 1 mm
}

TEST(ScanSource, CorrectionByAnAbsoluteMeasurementHasItsOwnEvent) {
  const std::vector<Pose2> path = circularPath(60);
  const auto measure = [&](std::size_t i) -> std::optional<Pose2> {
    if (i < 40) return std::nullopt;
    return Pose2{path[i].x_m + 0.3, path[i].y_m, path[i].theta_rad};
  };
  const ScanRun run = runScans(path, {}, {}, measure);
  const auto corrected = std::find_if(run.poses.begin(), run.poses.end(),
                                      [](const PoseEstimate& p) { return p.event != PoseEvent::kNone; });
  ASSERT_NE(corrected, run.poses.end());
  EXPECT_EQ(corrected->event, PoseEvent::kAbsolute);
  EXPECT_GT(corrected->correction_sigmas, 3.0);
}

/// Unconfirmed odometry puts the robot far outside the map, where no reference contradicts it. Its scans must
/// not extend the map there and then confirm themselves.
TEST(ScanSource, WrongPoseOutsideTheMapDoesNotConfirmItself) {
  const std::vector<Pose2> path = circularPath(60);
  const ScanRun run = runScans(path, {}, [](std::size_t i, Objects& frame) {
    if (i == 3) frame.motion.previous_from_current.x_m += 30.0;
  });
  int wrong = 0;
  for (std::size_t i = 10; i < path.size(); ++i)
    wrong += run.poses[i].state == LocalizationState::kLocalized && run.errors_m[i] > 0.1 ? 1 : 0;
  EXPECT_EQ(wrong, 0);
}

/// Tracked objects have replaced the motion of stalled wheels. The scan confirms the pose: the robot was not
/// kidnapped.
TEST(ScanSource, StalledWheelsAreNoKidnappingWhileTheScanMatches) {
  const std::vector<Pose2> path = circularPath(60);
  const ScanRun run = runScans(path, {}, [&](std::size_t i, Objects& frame) {
    if (i < 30 || i >= 40) return;
    frame.motion.previous_from_current = path[i - 1].inverse() * path[i];
    frame.motion.wheels_rejected = true;  // left_m and right_m are 0
  });
  EXPECT_EQ(run.status.losses, 0);
  EXPECT_GT(run.status.slips, 0);
  EXPECT_TRUE(run.poses[35].rejected.has(Source::kWheels));
  EXPECT_FALSE(run.poses[25].rejected.has(Source::kWheels));
  EXPECT_LT(run.worst_m, 0.02);
}

TEST(ScanSource, KidnappedRobotIsRelocalizedAndReported) {
  std::vector<Pose2> path = circularPath(50);
  path.push_back({-1.6, 0.6, 2.2});  // kidnapped, wheels at rest
  for (int i = 0; i < 50; ++i) path.push_back(path.back() * Pose2{kStep_m, 0.0, i < 25 ? -0.1 : 0.1});
  const auto kidnap = [](std::size_t i, Objects& frame) {
    if (i == 50) frame.motion.previous_from_current = {};
  };
  const ScanRun run = runScans(path, {}, kidnap);
  EXPECT_FALSE(run.poses[56].state == LocalizationState::kLocalized && run.errors_m[56] > 0.1)
      << "a wrong pose is not confirmed";
  const auto found = std::find_if(run.poses.begin(), run.poses.end(),
                                  [](const PoseEstimate& p) { return p.event == PoseEvent::kRelocalized; });
  ASSERT_NE(found, run.poses.end());
  EXPECT_GT(found->correction_sigmas, 0.0);
  EXPECT_TRUE(found->used.has(Source::kScan)) << "the search places it by its scan";
  EXPECT_LT(run.errors_m.back(), 0.03);
  EstimatorOptions no_search;
  no_search.relocalizer.min_matched = 1.0;
  const ScanRun not_relocalized = runScans(path, no_search, kidnap);
  EXPECT_GT(not_relocalized.errors_m.back(), 0.5) << "only the search relocalizes it";
  EXPECT_EQ(not_relocalized.poses.back().state, LocalizationState::kOdometryOnly);
  EXPECT_GT(std::sqrt(not_relocalized.poses.back().covariance.topLeftCorner<2, 2>().trace()), 0.5);
}

TEST(ScanSource, BeamsOnMovingObjectsAreIgnored) {
  const std::vector<Pose2> path = circularPath(80);
  // An object in front of half of the beams moves with the robot.
  const auto hide = [](bool labelled) {
    return [labelled](std::size_t, Objects& frame) {
      Boundary& b = frame.boundary;
      b.moving.assign(b.inverse_m.size(), 0);
      for (std::size_t k = 0; k < b.inverse_m.size() / 2; ++k) {
        b.inverse_m[k] = 2.5f;
        b.moving[k] = labelled ? 1 : 0;
      }
    };
  };
  const double labelled_m = runScans(path, {}, hide(true)).worst_m;
  EXPECT_LT(labelled_m, 0.01);
  EXPECT_GT(runScans(path, {}, hide(false)).worst_m, 2.0 * labelled_m);
}

}  // namespace
}  // namespace omnifleet::estimation
