// Robots that do not know where they started: nothing of them enters the common map before their maps match,
// and everything does afterwards. Scans are exact intersections with noise, wheels err by 3 %.
#include "localizer/own_frames.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "localizer/estimator_stage.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::localizer {
namespace {

using scan::testing::Scene;

constexpr TimeNs kOwnFramePeriod_ns = 200000000;
constexpr double kCircleStep_m = 0.06, kCircleTurn_rad = 0.08, kWheelError = 0.03,
                 kNoise = 0.003;  // 1/m, of scans

/// A circle of 0.75 m in the room, from some place on it.
std::vector<Pose2> circle(double from_rad, int frames) {
  const Pose2 centre{0.2, -0.45, 0.0};
  std::vector<Pose2> path{centre * Pose2{0.75 * std::sin(from_rad), -0.75 * std::cos(from_rad), from_rad}};
  for (int i = 1; i < frames; ++i) path.push_back(path.back() * Pose2{kCircleStep_m, 0.0, kCircleTurn_rad});
  return path;
}

class TwoRobots {
 public:
  TwoRobots(Scene first, Scene second, int frames)
      : rooms_{std::move(first), std::move(second)}, paths_{circle(0.0, frames), circle(2.5, frames)} {}

  struct Run {
    std::vector<PoseEstimate> poses;      ///< of r2
    std::map<TimeNs, PoseEstimate> last;  ///< of r2, as published last
    std::vector<Alignment> alignments;
    std::vector<Message> findings;
    int of_r1 = 0;  ///< alignments
  };

  Run drive() {
    std::vector<estimation::RobotSetup> setups(2);
    setups[0].name = "r1";
    setups[1].name = "r2";
    for (auto& setup : setups) {
      setup.body.radius_m = 0.1;
      setup.body.wheel_separation_m = 0.2;
    }
    setups[0].initial_pose = paths_[0].front();
    EstimatorStage stage(setups, {}, {{"r2", Pose2{}}});
    Run run;
    const auto publish = [&](const PoseEstimate& pose) {
      if (pose.robot == "r2" && pose.valid) run.last[pose.acquired_ns] = pose;
    };
    for (std::size_t i = 0; i < paths_[0].size(); ++i) {
      const Objects a = frame(0, i), b = frame(1, i);
      const auto poses = stage.process(a.acquired_ns, {&a, &b}, {});
      run.poses.push_back(poses[1]);
      publish(poses[1]);
      if (stage.refineDue()) stage.refine();
      for (const PoseEstimate& pose : stage.takeRevised()) publish(pose);
      take(stage, run);
    }
    for (const PoseEstimate& pose : stage.finish()) publish(pose);
    for (const PoseEstimate& pose : stage.takeRevised()) publish(pose);
    take(stage, run);
    return run;
  }

  const std::vector<Pose2>& path(std::size_t robot) const { return paths_[robot]; }

 private:
  static void take(EstimatorStage& stage, Run& run) {
    for (Alignment& alignment : stage.takeAlignments()) {
      if (alignment.robot == "r2")
        run.alignments.push_back(std::move(alignment));
      else
        ++run.of_r1;
    }
    for (Message& finding : stage.takeFindings()) run.findings.push_back(std::move(finding));
  }

  Objects frame(std::size_t robot, std::size_t i) {
    const std::vector<Pose2>& path = paths_[robot];
    Objects frame;
    frame.robot = robot == 0 ? "r1" : "r2";
    frame.acquired_ns = static_cast<TimeNs>(i + 1) * kOwnFramePeriod_ns;
    frame.sequence = static_cast<std::uint32_t>(i);
    frame.boundary = rooms_[robot].scan(path[i], kNoise, random_);
    frame.motion.since_ns = frame.acquired_ns - kOwnFramePeriod_ns;
    frame.motion.valid = i > 0;
    if (i > 0) {
      frame.motion.previous_from_current = path[i - 1].inverse() * path[i];
      frame.motion.previous_from_current.x_m *= 1.0 + kWheelError;
      frame.motion.previous_from_current.theta_rad *= 1.0 - kWheelError;
      frame.motion.covariance = Eigen::Vector3d(1e-5, 1e-5, 1e-5).asDiagonal();
      frame.motion.left_m = frame.motion.right_m = kCircleStep_m;
    }
    return frame;
  }

  std::vector<Scene> rooms_;
  std::vector<std::vector<Pose2>> paths_;
  std::mt19937 random_{5};
};

Scene otherFurniture() {
  Scene room = scan::testing::furnishedRoom();
  room.outlines.resize(1);
  room.outlines.push_back({{-2.5, -2.0}, {-1.2, -2.0}, {-1.2, -1.4}, {-2.5, -1.4}});
  room.outlines.push_back({{1.3, 1.3}, {2.5, 1.3}, {2.5, 2.0}, {1.3, 2.0}});
  room.outlines.push_back({{-1.6, 0.2}, {-1.2, 0.2}, {-1.2, 0.7}, {-1.6, 0.7}});
  return room;
}

TEST(OwnFrames, JoinTheCommonMapOnceBothMapsMatch) {
  const Scene room = scan::testing::furnishedRoom();
  TwoRobots robots(room, room, 80);
  const TwoRobots::Run run = robots.drive();
  EXPECT_EQ(run.of_r1, 1);  // anchored
  ASSERT_FALSE(run.alignments.empty());
  EXPECT_EQ(run.alignments.front().status, AlignmentStatus::kUndecided);
  EXPECT_EQ(run.alignments.front().frame, "r2");
  ASSERT_EQ(run.alignments.back().status, AlignmentStatus::kMatched) << run.alignments.back().reason;
  EXPECT_EQ(run.alignments.back().frame, "");
  EXPECT_LT(run.alignments.back().acquired_ns, 40 * kOwnFramePeriod_ns);  // before half of the run
  const Pose2 off = robots.path(1).front().inverse() * run.alignments.back().map_from_frame;
  EXPECT_LT(off.translation().norm(), 0.03);
  EXPECT_LT(std::abs(off.theta_rad), 0.02);
  ASSERT_EQ(run.findings.size(), 1u);
  EXPECT_EQ(run.findings.front().code, ErrorCode::kFrameMatched);

  // Live: own frame first, map afterwards; never back.
  EXPECT_EQ(run.poses.front().frame, "r2");
  EXPECT_EQ(run.poses.back().frame, "");
  const auto changes = std::count_if(run.poses.begin() + 1, run.poses.end(), [&](const PoseEstimate& pose) {
    return pose.frame != (&pose - 1)->frame;
  });
  EXPECT_EQ(changes, 1);

  // In the end all of its frames are in map, where the robot was.
  ASSERT_EQ(run.last.size(), robots.path(1).size());
  std::size_t i = 0;
  for (const auto& [time, pose] : run.last) {
    EXPECT_EQ(pose.frame, "") << i;
    const Pose2 error = robots.path(1)[i].inverse() * pose.map_from_base;
    EXPECT_LT(error.translation().norm(), 0.02) << i;  // scans of 1 cm at 2 m, wheels of 3 %
    EXPECT_LT(std::abs(error.theta_rad), 0.015) << i;
    ++i;
  }
}

TEST(OwnFrames, KeepALookAlikeRoomOutOfTheCommonMap) {
  TwoRobots robots(scan::testing::furnishedRoom(), otherFurniture(), 80);
  const TwoRobots::Run run = robots.drive();
  for (const Alignment& alignment : run.alignments)
    EXPECT_NE(alignment.status, AlignmentStatus::kMatched) << alignment.reason;
  for (const auto& [time, pose] : run.last) EXPECT_EQ(pose.frame, "r2");
  ASSERT_EQ(run.findings.size(), 1u);
  EXPECT_EQ(run.findings.front().code, ErrorCode::kFrameNotMatched);
  // Its own map is as good as alone: it begins at its first pose.
  for (const auto& [time, pose] : run.last) {
    const auto i = static_cast<std::size_t>(time / kOwnFramePeriod_ns - 1);
    const Pose2 truth = robots.path(1).front().inverse() * robots.path(1)[i];
    EXPECT_LT((truth.inverse() * pose.map_from_base).translation().norm(), 0.02) << i;
  }
}

TEST(OwnFrames, GiveTheSameResultTwice) {
  const Scene room = scan::testing::furnishedRoom();
  const TwoRobots::Run a = TwoRobots(room, room, 50).drive(), b = TwoRobots(room, room, 50).drive();
  ASSERT_EQ(a.last.size(), b.last.size());
  for (const auto& [time, pose] : a.last)
    EXPECT_EQ(pose.map_from_base.vector(), b.last.at(time).map_from_base.vector());
}

}  // namespace
}  // namespace omnifleet::localizer
