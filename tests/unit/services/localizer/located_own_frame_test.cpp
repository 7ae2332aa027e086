// A robot in its own frame that mutual sightings locate: it leaves that frame with its whole path. Truth: the
// paths of the fleet simulator, whose outlines are independent of the estimator's formulas.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <vector>

#include "localizer/estimator_stage.h"
#include "tests/unit/estimation/fleet_simulator.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::localizer {
namespace {

using estimation::testing::FleetSimulator;
using estimation::testing::pointers;

constexpr int kSimulated = 25,
              kFirstAllowed = 10;   // frames; before, sightings locate no robot in its own frame
constexpr std::size_t kSecond = 1;  // r2, the robot without an initial pose

struct SeenRun {
  int located_at = -1;                     ///< first frame of r2 in map
  std::vector<PoseEstimate> live;          ///< of r2
  std::map<TimeNs, PoseEstimate> last;     ///< of r2, as published last
  std::map<TimeNs, PoseEstimate> revised;  ///< of r2, published again at the frame that located it
  std::vector<Alignment> alignments;       ///< of r2
  std::vector<Message> findings;
};

/// @param walls seen by the scans of r2 alone; without any, no robot has scans
SeenRun drive(FleetSimulator& simulator, const scan::testing::Scene& walls = {}) {
  auto setups = simulator.setups();
  setups[kSecond].initial_pose.reset();
  EstimatorStage stage(setups, {}, {{"r2", Pose2{}}});
  SeenRun run;
  std::mt19937 noise(1);
  const auto publish = [&](const PoseEstimate& pose) {
    if (pose.robot == "r2" && pose.valid) run.last[pose.acquired_ns] = pose;
  };
  const auto take = [&] {
    for (const PoseEstimate& pose : stage.takeRevised()) publish(pose);
    for (const Alignment& alignment : stage.takeAlignments())
      if (alignment.robot == "r2") run.alignments.push_back(alignment);
    for (const Message& finding : stage.takeFindings()) run.findings.push_back(finding);
  };
  for (int f = 0; f < kSimulated; ++f) {
    auto frames = simulator.frames(f);
    if (!walls.outlines.empty()) frames[kSecond].boundary = walls.scan(simulator.truth(1, f), 0.003, noise);
    const PoseEstimate pose = stage.process(simulator.time(f), pointers(frames), {})[kSecond];
    run.live.push_back(pose);
    publish(pose);
    if (run.located_at < 0 && pose.valid && pose.frame.empty()) {
      run.located_at = f;
      for (const PoseEstimate& again : stage.takeRevised())
        if (again.robot == "r2") run.revised[again.acquired_ns] = again;
      for (const auto& [time, again] : run.revised) publish(again);
    }
    if (stage.refineDue()) stage.refine();
    take();
  }
  for (const PoseEstimate& pose : stage.finish()) publish(pose);
  take();
  return run;
}

FleetSimulator threeRobots() {
  estimation::testing::SimulationOptions options;
  options.sight_m = 4.0;
  options.frames = 2 * kSimulated;  // paths depend on it
  return FleetSimulator(options, 3);
}

TEST(LocatedOwnFrame, ItsWholePathMovesToMap) {
  FleetSimulator simulator = threeRobots();
  const SeenRun run = drive(simulator);
  ASSERT_GE(run.located_at, kFirstAllowed);
  for (int f = 0; f < kSimulated; ++f) {
    const auto& pose = run.live[static_cast<std::size_t>(f)];
    ASSERT_TRUE(pose.valid) << f;
    EXPECT_EQ(pose.frame, f < run.located_at ? "r2" : "") << f;
  }
  // All frames before are published again at once, in map. Wheels of 2 % scatter over at most 15 steps of 5
  // cm; the sighting itself has σ 5 cm at most.
  ASSERT_EQ(run.revised.size(), static_cast<std::size_t>(run.located_at));
  ASSERT_EQ(run.last.size(), static_cast<std::size_t>(kSimulated));
  for (int f = 0; f < kSimulated; ++f) {
    const PoseEstimate& pose = run.last.at(simulator.time(f));
    EXPECT_EQ(pose.frame, "") << f;
    EXPECT_EQ(pose.sequence, static_cast<std::uint32_t>(f));
    const Pose2 off = simulator.truth(1, f).inverse() * pose.map_from_base;
    EXPECT_LT(off.translation().norm(), f < run.located_at ? 0.05 : 0.02) << f;
    EXPECT_LT(std::abs(off.theta_rad), 0.05) << f;
  }
}

TEST(LocatedOwnFrame, ItsAlignmentReportsTheTrueRelation) {
  FleetSimulator simulator = threeRobots();
  const SeenRun run = drive(simulator);
  ASSERT_GE(run.located_at, 0);
  ASSERT_FALSE(run.alignments.empty());
  EXPECT_EQ(run.alignments.front().status, AlignmentStatus::kUndecided);
  EXPECT_EQ(run.alignments.front().frame, "r2");
  const Alignment& last = run.alignments.back();
  EXPECT_EQ(last.status, AlignmentStatus::kMatched);
  EXPECT_EQ(last.frame, "");
  EXPECT_EQ(last.acquired_ns, simulator.time(run.located_at));
  EXPECT_EQ(last.reason, "other robots and obstacles that both see");
  // Its frame began at its first pose.
  const Eigen::Vector3d off = (simulator.truth(1, 0).inverse() * last.map_from_frame).vector();
  EXPECT_LT(off.head<2>().norm(), 0.05);
  EXPECT_LT(std::abs(off.z()), 0.05);
  ASSERT_GT(last.covariance.ldlt().vectorD().minCoeff(), 0.0) << "a relation that was measured has a σ";
  EXPECT_LT(off.dot(last.covariance.ldlt().solve(off)), 16.3) << "99.9 % of χ² with 3 degrees of freedom";
  EXPECT_LT(std::sqrt(last.covariance(0, 0)), 0.1);
  EXPECT_TRUE(run.findings.empty()) << run.findings.front().text;
}

/// Scans decide where there are any: sightings could relate two rooms that look alike through one body.
TEST(LocatedOwnFrame, SightingsDoNotLocateARobotWithScans) {
  const scan::testing::Scene walls{{{{-2.5, -2.5}, {2.5, -2.5}, {2.5, 2.5}, {-2.5, 2.5}},
                                    {{-2.5, 2.1}, {-1.9, 2.1}, {-1.9, 2.5}, {-2.5, 2.5}}}};
  FleetSimulator simulator = threeRobots();
  const SeenRun run = drive(simulator, walls);
  EXPECT_EQ(run.located_at, -1);
  for (int f = 0; f < kSimulated; ++f) {
    const PoseEstimate& pose = run.last.at(simulator.time(f));
    EXPECT_EQ(pose.frame, "r2") << f;
    const Pose2 truth = simulator.truth(1, 0).inverse() * simulator.truth(1, f);
    EXPECT_LT((truth.inverse() * pose.map_from_base).translation().norm(), 0.03) << f;
  }
  ASSERT_FALSE(run.alignments.empty());
  EXPECT_EQ(run.alignments.back().status, AlignmentStatus::kUndecided);
  EXPECT_EQ(run.alignments.back().reason, "the common map has no scan yet") << "only r2 has scans";
}

}  // namespace
}  // namespace omnifleet::localizer
