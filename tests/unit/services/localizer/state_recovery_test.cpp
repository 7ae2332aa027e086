// A localizer that is restarted while a robot maps in a frame of its own. Truth: closed-form paths.
#include "localizer/state_recovery.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "localizer/estimator_stage.h"
#include "tests/unit/estimation/circling_robots.h"

namespace omnifleet::localizer {
namespace {

using estimation::testing::CirclingRobots;

constexpr std::uint32_t kKept = 64;
const std::map<std::string, Pose2> kMayMapAlone{{"r2", Pose2{}}};

/// As a replica of the map holds it. @param frame empty: map
occupancy::KeyframePose keyframe(const std::string& robot, TimeNs time_ns, const Pose2& pose,
                                 const std::string& frame, std::uint32_t term = 0) {
  PoseEstimate estimate;
  estimate.robot = robot;
  estimate.acquired_ns = time_ns;
  estimate.valid = true;
  estimate.frame = frame;
  estimate.map_from_base = pose;
  return occupancy::makeKeyframePose(estimate, term);
}

Objects frameAt(const std::string& robot, TimeNs time_ns) {
  Objects frame;
  frame.robot = robot;
  frame.acquired_ns = time_ns;
  return frame;
}

StateRecovery recoveryOfTwo() {
  estimation::RobotSetup r1, r2;
  r1.name = "r1";
  r1.initial_pose = Pose2{1.0, 2.0, 0.5};
  r2.name = "r2";
  r1.body.radius_m = r2.body.radius_m = 0.15;
  return {{r1, r2}, {}, kKept, {"r1", "r2"}};
}

TEST(StateRecovery, ReturnsARobotToItsOwnFrameWhereItWas) {
  StateRecovery recovery = recoveryOfTwo();
  recovery.receive(frameAt("r1", 500));
  recovery.receive(frameAt("r2", 500));
  recovery.receive(keyframe("r1", 700, {1.5, 2.0, 0.5}, ""));
  EXPECT_FALSE(recovery.isComplete());
  recovery.receive(keyframe("r2", 600, {0.2, 0.0, 0.0}, "r2"));
  recovery.receive(keyframe("r2", 800, {1.2, -0.4, 0.7}, "r2"));
  EXPECT_TRUE(recovery.isComplete());
  EXPECT_EQ(recovery.inMap(), std::set<std::string>{"r1"});
  const auto own = recovery.ownFrames(kMayMapAlone);
  ASSERT_EQ(own.size(), 1U);
  // Keyframe poses are rounded to 0.1 mm and 0.1 mrad.
  EXPECT_LT((own.at("r2").vector() - Eigen::Vector3d(1.2, -0.4, 0.7)).norm(), 1e-4);
  EXPECT_TRUE(recovery.isPast("r2", 799));
  EXPECT_FALSE(recovery.isPast("r2", 800)) << "its frame begins there";
  EXPECT_FALSE(recovery.recoverPose(frameAt("r2", 800))) << "numbers of its own frame are no place in map";
  EXPECT_TRUE(recovery.takeUnknownRobots().empty());
  for (const estimation::RobotSetup& setup : recovery.setups())
    EXPECT_FALSE(setup.initial_pose) << setup.name;
}

/// The localizer has matched it and published its frames again, in map, before it failed.
TEST(StateRecovery, ReturnsAMatchedRobotToMap) {
  StateRecovery recovery = recoveryOfTwo();
  recovery.receive(keyframe("r2", 800, {1.2, -0.4, 0.7}, "r2"));
  recovery.receive(keyframe("r2", 800, {-3.0, 1.0, 2.0}, "", 1));
  recovery.receive(keyframe("r2", 800, {1.2, -0.4, 0.7}, "r2"));  // of another replica, late
  recovery.receive(keyframe("r2", 700, {1.1, -0.4, 0.7}, "r2"));
  EXPECT_TRUE(recovery.ownFrames(kMayMapAlone).empty());
  EXPECT_EQ(recovery.inMap(), std::set<std::string>{"r2"});
  const auto pose = recovery.recoverPose(frameAt("r2", 800));
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->kind, MeasurementKind::kAbsolutePose);
  EXPECT_EQ(pose->to, "r2");
  EXPECT_LT((pose->value - Eigen::Vector3d(-3.0, 1.0, 2.0)).norm(), 1e-4);
}

TEST(StateRecovery, BeginsTheOwnFrameOfARobotThatHasNoPoseYet) {
  StateRecovery recovery = recoveryOfTwo();
  recovery.receive(keyframe("r1", 700, {1.5, 2.0, 0.5}, ""));
  const auto own = recovery.ownFrames(kMayMapAlone);
  ASSERT_EQ(own.size(), 1U);
  EXPECT_EQ(own.at("r2").vector(), Eigen::Vector3d::Zero());
}

/// Two robots, and a localizer that fails and is restarted. Replicas keep the poses of all frames, the
/// classifiers the last frame.
class RestartedStage {
 public:
  RestartedStage(const scan::testing::Scene& second_room, std::size_t frames, std::size_t restart_at)
      : robots({scan::testing::furnishedRoom(), second_room}, static_cast<int>(frames)) {
    for (std::size_t i = 0; i < frames; ++i) {
      frames_.push_back({robots.frame(0, i), robots.frame(1, i)});
    }
    EstimatorStage first(robots.setups(), {}, kMayMapAlone);
    run(first, 0, restart_at, 1);
    before = alignments.empty() ? AlignmentStatus::kUndecided : alignments.back().status;
    alignments.clear();

    StateRecovery recovery(robots.setups(), {}, kKept, {"r1", "r2"});
    for (const auto& [key, pose] : held_) recovery.receive(pose);
    EstimatorStage second(recovery.setups(), {}, recovery.ownFrames(kMayMapAlone));
    second.keepAlignments(recovery.inMap());
    recovery_ = &recovery;
    live.clear();
    run(second, restart_at - 1, frames, 2);
    for (const PoseEstimate& pose : second.finish()) hold(pose, 2);
    is_in_map = second.estimator().isLocated("r2");
  }

  CirclingRobots robots;
  AlignmentStatus before;                                 ///< of r2 when the localizer failed
  std::map<std::size_t, std::vector<PoseEstimate>> live;  ///< both robots, by frame, after the restart
  std::vector<Alignment> alignments;                      ///< of r2, after the restart
  bool is_in_map = false;                                 ///< r2, at the end

 private:
  void run(EstimatorStage& stage, std::size_t from, std::size_t to, std::uint32_t term) {
    for (std::size_t i = from; i < to; ++i) {
      const Objects &a = frames_[i][0], &b = frames_[i][1];
      std::vector<Measurement> recovered;
      for (const Objects* frame : {&a, &b}) {
        const auto pose = recovery_ ? recovery_->recoverPose(*frame) : std::nullopt;
        if (pose) recovered.push_back(*pose);
      }
      std::vector<const Measurement*> measurements;
      for (const Measurement& pose : recovered) measurements.push_back(&pose);
      live[i] = stage.process(a.acquired_ns, {&a, &b}, measurements);
      for (const PoseEstimate& pose : live[i]) hold(pose, 0);
      if (stage.refineDue()) stage.refine();
      for (const PoseEstimate& pose : stage.takeRevised()) hold(pose, term);
      for (Alignment& alignment : stage.takeAlignments())
        if (alignment.robot == "r2") alignments.push_back(std::move(alignment));
    }
  }
  void hold(const PoseEstimate& pose, std::uint32_t term) {
    if (!pose.valid) return;
    const auto [at, fresh] = held_.try_emplace({pose.robot, pose.acquired_ns});
    if (fresh || at->second.term <= term) at->second = occupancy::makeKeyframePose(pose, term);
  }

  std::vector<std::vector<Objects>> frames_;
  StateRecovery* recovery_ = nullptr;
  std::map<std::pair<std::string, TimeNs>, occupancy::KeyframePose> held_;
};

// The last pose before the restart may be 2 cm off, as everywhere in these rooms; the new map begins there.
constexpr double kRestarted_m = 0.04, kRestarted_rad = 0.03;

void expectNear(const Pose2& truth, const PoseEstimate& pose, std::size_t frame) {
  ASSERT_TRUE(pose.valid) << frame;
  const Pose2 off = truth.inverse() * pose.map_from_base;
  EXPECT_LT(off.translation().norm(), kRestarted_m) << pose.robot << ", frame " << frame;
  EXPECT_LT(std::abs(off.theta_rad), kRestarted_rad) << pose.robot << ", frame " << frame;
}

TEST(RestartedStage, KeepsTheOwnFrameOfARobotThatMatchesNothing) {
  const RestartedStage run(estimation::testing::lookAlikeRoom(), 50, 20);
  ASSERT_NE(run.before, AlignmentStatus::kMatched);
  const std::vector<Pose2>&first = run.robots.path(0), &second = run.robots.path(1);
  for (const auto& [i, poses] : run.live) {
    expectNear(first[i], poses[0], i);
    EXPECT_EQ(poses[0].frame, "");
    expectNear(second.front().inverse() * second[i], poses[1], i);
    EXPECT_EQ(poses[1].frame, "r2") << i;
  }
  EXPECT_FALSE(run.is_in_map);
}

/// The relation that is found after the restart is that of the frame that began before it.
TEST(RestartedStage, MatchesTheOwnFrameThatBeganBefore) {
  const RestartedStage run(scan::testing::furnishedRoom(), 80, 6);
  ASSERT_NE(run.before, AlignmentStatus::kMatched);
  ASSERT_FALSE(run.alignments.empty());
  ASSERT_EQ(run.alignments.back().status, AlignmentStatus::kMatched) << run.alignments.back().reason;
  const std::vector<Pose2>& path = run.robots.path(1);
  const Pose2 off = path.front().inverse() * run.alignments.back().map_from_frame;
  EXPECT_LT(off.translation().norm(), kRestarted_m);
  EXPECT_LT(std::abs(off.theta_rad), kRestarted_rad);
  EXPECT_EQ(run.live.at(5)[1].frame, "r2");
  EXPECT_EQ(run.live.at(79)[1].frame, "");
  for (const auto& [i, poses] : run.live)
    expectNear(poses[1].frame.empty() ? path[i] : path.front().inverse() * path[i], poses[1], i);
}

TEST(RestartedStage, KeepsAMatchedRobotInMap) {
  const RestartedStage run(scan::testing::furnishedRoom(), 80, 60);
  ASSERT_EQ(run.before, AlignmentStatus::kMatched);
  for (const auto& [i, poses] : run.live) {
    EXPECT_EQ(poses[1].frame, "") << i;
    expectNear(run.robots.path(1)[i], poses[1], i);
  }
  EXPECT_TRUE(run.is_in_map);
  EXPECT_TRUE(run.alignments.empty()) << "the relation that was published before still holds";
}

}  // namespace
}  // namespace omnifleet::localizer
