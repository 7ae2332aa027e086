// Robots that do not know where they started: nothing of them enters the common map before their maps match,
// and everything does afterwards. Scans are exact intersections with noise, wheels err by 3 %.
#include "localizer/own_frames.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "localizer/estimator_stage.h"
#include "tests/unit/estimation/circling_robots.h"

namespace omnifleet::localizer {
namespace {

using estimation::testing::CirclingRobots;
using estimation::testing::lookAlikeRoom;
using scan::testing::Scene;

constexpr TimeNs kOwnFramePeriod_ns = CirclingRobots::kPeriod_ns;

class TwoRobots {
 public:
  TwoRobots(Scene first, Scene second, int frames) : robots_({std::move(first), std::move(second)}, frames) {}

  struct Run {
    std::vector<PoseEstimate> poses;      ///< of r2
    std::map<TimeNs, PoseEstimate> last;  ///< of r2, as published last
    std::vector<Alignment> alignments;
    std::vector<Message> findings;
    int of_r1 = 0;  ///< alignments
  };

  Run drive() {
    EstimatorStage stage(robots_.setups(), {}, {{"r2", Pose2{}}});
    Run run;
    const auto publish = [&](const PoseEstimate& pose) {
      if (pose.robot == "r2" && pose.valid) run.last[pose.acquired_ns] = pose;
    };
    for (std::size_t i = 0; i < path(0).size(); ++i) {
      const Objects a = robots_.frame(0, i), b = robots_.frame(1, i);
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

  const std::vector<Pose2>& path(std::size_t robot) const { return robots_.path(robot); }

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

  CirclingRobots robots_;
};

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
  TwoRobots robots(scan::testing::furnishedRoom(), lookAlikeRoom(), 80);
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

/// The end of the run reports why: the finding repeats the last published reason.
void expectReported(const TwoRobots::Run& run, AlignmentStatus status, const std::string& reason) {
  ASSERT_FALSE(run.alignments.empty());
  const Alignment& last = run.alignments.back();
  EXPECT_EQ(last.status, status) << last.reason;
  EXPECT_EQ(last.frame, "r2");
  EXPECT_NE(last.reason.find(reason), std::string::npos) << last.reason;
  ASSERT_EQ(run.findings.size(), 1u);
  const Message& finding = run.findings.front();
  EXPECT_EQ(finding.code, ErrorCode::kFrameNotMatched);
  EXPECT_EQ(finding.text.rfind("r2: ", 0), 0u) << finding.text;
  EXPECT_NE(finding.text.find("(" + last.reason + ")"), std::string::npos) << finding.text;
  EXPECT_EQ(finding.text.find("contradicts the common map") != std::string::npos,
            status == AlignmentStatus::kRefused)
      << finding.text;
}

TEST(OwnFrames, ReportAtTheEndThatMapsContradict) {
  TwoRobots robots(scan::testing::furnishedRoom(), lookAlikeRoom(), 80);
  expectReported(robots.drive(), AlignmentStatus::kRefused, "contradict");
}

TEST(OwnFrames, ReportAtTheEndThatSeveralRelationsFit) {
  const Scene symmetric{{{{-2.5, -2.0}, {2.5, -2.0}, {2.5, 2.0}, {-2.5, 2.0}},
                         {{1.7, 1.2}, {2.4, 1.2}, {2.4, 1.9}, {1.7, 1.9}},
                         {{-2.4, -1.9}, {-1.7, -1.9}, {-1.7, -1.2}, {-2.4, -1.2}},
                         {{-0.4, 1.3}, {0.1, 1.3}, {0.1, 2.0}, {-0.4, 2.0}},
                         {{-0.1, -2.0}, {0.4, -2.0}, {0.4, -1.3}, {-0.1, -1.3}}}};
  TwoRobots robots(symmetric, symmetric, 60);
  expectReported(robots.drive(), AlignmentStatus::kUndecided, "another relation");
}

TEST(OwnFrames, ReportAtTheEndThatNoScanWasMade) {
  TwoRobots robots(scan::testing::furnishedRoom(), Scene{}, 20);
  expectReported(robots.drive(), AlignmentStatus::kUndecided, "no scan yet");
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
