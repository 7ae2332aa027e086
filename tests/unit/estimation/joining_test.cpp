// A robot with an estimator of its own joins the common estimator. Sightings locate a robot only if allowed.
// Truth: the closed-form paths of the simulators.
#include "estimation/joining.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <vector>

#include "circling_robots.h"
#include "estimation/estimator.h"
#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

using testing::CirclingRobots;
using testing::FleetSimulator;

constexpr std::size_t kFramesAfterJoin = 6;
// Scans have σ of 1 cm at 2 m and some hundred lines. The errors of a keyframe, its constraints and a match
// add up.
constexpr double kJoined_m = 0.02, kJoined_rad = 0.015;

/// r2 alone, in a frame that begins at its first pose.
std::vector<RobotSetup> onlySecond(std::vector<RobotSetup> setups) {
  setups[0].initial_pose.reset();
  setups[1].initial_pose = Pose2{};
  setups[1].founds_map = true;
  return setups;
}

struct Joined {
  bool at_keyframe = false;             ///< the newest frame had just become a keyframe
  std::map<TimeNs, PoseEstimate> last;  ///< of r2 in the common map, as published last
  std::vector<PoseEstimate> live;       ///< of r2, from the first frame after joining
};

/// r2 joins with the true relation after both estimators have refined frame `at`.
Joined joinAfter(CirclingRobots& robots, std::size_t at) {
  const auto setups = robots.setups();
  FleetEstimator common(setups, {}), own(onlySecond(setups), {});
  Joined joined;
  for (std::size_t i = 0; i <= at; ++i) {
    const Objects a = robots.frame(0, i), b = robots.frame(1, i);
    common.process(robots.time(i), {&a, &b}, {});
    own.process(robots.time(i), {&b}, {});
    const std::size_t before = own.keyframes().size();
    common.refine();
    own.refine();
    joined.at_keyframe = own.keyframes().size() > before;
  }
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();
  common.join("r2", own, robots.path(1).front(), covariance);
  const auto note = [&](const std::vector<PoseEstimate>& poses) {
    for (const PoseEstimate& pose : poses)
      if (pose.robot == "r2") joined.last[pose.acquired_ns] = pose;
  };
  for (std::size_t i = at + 1; i <= at + kFramesAfterJoin; ++i) {
    const Objects a = robots.frame(0, i), b = robots.frame(1, i);
    joined.live.push_back(common.process(robots.time(i), {&a, &b}, {})[1]);
    note({joined.live.back()});
    common.refine();
    note(common.takeRevised());
  }
  note(common.finish());
  note(common.takeRevised());
  return joined;
}

TEST(Joining, PosesAreCorrectWhetherOrNotTheNewestFrameIsAKeyframe) {
  const scan::testing::Scene room = scan::testing::furnishedRoom();
  constexpr std::size_t kFirst = 3, kLast = 14;
  int at_keyframe = 0, between = 0;
  for (std::size_t at = kFirst; at <= kLast; ++at) {
    CirclingRobots robots({room, room}, static_cast<int>(at + kFramesAfterJoin) + 1);
    const Joined joined = joinAfter(robots, at);
    ++(joined.at_keyframe ? at_keyframe : between);
    for (std::size_t k = 0; k < joined.live.size(); ++k) {
      const PoseEstimate& pose = joined.live[k];
      ASSERT_TRUE(pose.valid) << at << " + " << k;
      EXPECT_EQ(pose.state, LocalizationState::kLocalized) << at << " + " << k;
      ASSERT_TRUE(pose.map_from_base.isFinite() && pose.covariance.allFinite()) << at << " + " << k;
      EXPECT_GT(pose.covariance.ldlt().vectorD().minCoeff(), 0.0) << at << " + " << k;
    }
    ASSERT_EQ(joined.last.size(), at + kFramesAfterJoin + 1) << "all its frames are in the common map";
    std::size_t i = 0;
    for (const auto& [time, pose] : joined.last) {
      ASSERT_TRUE(pose.map_from_base.isFinite()) << at << ", frame " << i;
      const Pose2 off = robots.path(1)[i].inverse() * pose.map_from_base;
      EXPECT_LT(off.translation().norm(), kJoined_m) << at << ", frame " << i;
      EXPECT_LT(std::abs(off.theta_rad), kJoined_rad) << at << ", frame " << i;
      ++i;
    }
  }
  EXPECT_GE(at_keyframe, 2) << "some joins at a keyframe";
  EXPECT_GE(between, 2);
}

TEST(Joining, SightingsLocateOnlyIfAllowed) {
  constexpr int kAllowed = 10, kFrames = 20;
  testing::SimulationOptions options;
  options.sight_m = 4.0;
  options.frames = kFrames;
  FleetSimulator simulator(options, 3);
  auto setups = simulator.setups();
  setups[1].initial_pose.reset();
  FleetEstimator allowed(setups, {}), estimator(setups, {});
  estimator.allowSightings("r2", false);
  for (int f = 0; f < kFrames; ++f) {
    if (f == kAllowed) estimator.allowSightings("r2", true);
    const auto frames = simulator.frames(f);
    const auto poses = estimator.process(simulator.time(f), testing::pointers(frames), {});
    estimator.refine();
    EXPECT_EQ(poses[1].valid, f >= kAllowed) << f;
    EXPECT_TRUE(allowed.process(simulator.time(f), testing::pointers(frames), {})[1].valid)
        << f << ": sightings can locate it from the first frame on";
    if (!poses[1].valid) continue;
    const Eigen::Vector2d off = poses[1].map_from_base.translation() - simulator.truth(1, f).translation();
    EXPECT_LT(off.norm(), 0.02) << f;  // as in FleetEstimator.RobotWithoutInitialPoseIsLocatedBySightings
  }
}

}  // namespace
}  // namespace omnifleet::estimation
