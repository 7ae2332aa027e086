// Progress of the replica that publishes the map. Live mode: when it publishes. Replay mode: which poses it
// waits for.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>
#include <string>

#include "adapters/adapters.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

constexpr TimeNs kStep = 400'000'000;

/// The merger of the first robot. The test plays its classifier, its localizer and the other robot.
class MergerFixture : public testing::Test {
 protected:
  explicit MergerFixture(bus::RunMode mode) : bench_("global_merger", "r1", "", "", mode) {}
  /// @param lump an obstacle without a track, one metre ahead
  void objects(int step, bool lump = false) {
    Objects seen;
    seen.robot = "r1";
    seen.acquired_ns = step * kStep;
    seen.sequence = static_cast<std::uint32_t>(step);
    seen.scan.range_m.assign(360, 1.5F);
    seen.scan.sigma_m.assign(360, 0.01F);
    seen.scan.label.assign(360, RayLabel::kObstacle);
    seen.scan.object.assign(360, 0);
    if (lump) {
      seen.scan.label.assign(360, RayLabel::kFloorEnd);
      for (std::size_t k = 0; k < 12; ++k) {
        seen.scan.label[k] = RayLabel::kObstacle;
        const float from_middle = std::abs(static_cast<float>(k) - 6.0F);
        seen.scan.range_m[k] = 1.0F + 0.03F * from_middle;  // a corner that faces the robot
      }
    }
    v1::Objects wire;
    adapters::toWire(seen, adapters::RunClock::kSystem, wire);
    ASSERT_TRUE(objects_->write(wire));
    bench_.spin();
  }
  /// @param others last published pose times of the other robots
  void pose(const std::string& robot, int step, const std::map<std::string, int>& others = {}) {
    PoseEstimate estimate;
    estimate.robot = robot;
    estimate.acquired_ns = step * kStep;
    estimate.sequence = static_cast<std::uint32_t>(step);
    estimate.valid = true;
    estimate.map_from_base = {0.1 * step, robot == "r1" ? 0.0 : 1.0, 0.0};  // far enough for a keyframe
    estimate.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();
    v1::Pose wire;
    adapters::toWire(estimate, adapters::RunClock::kSystem, 0, wire);
    for (const auto& [other, last] : others) {
      v1::PublishedPose& published = wire.published().emplace_back();
      published.robot(other);
      published.last_ns(last * kStep);
    }
    ASSERT_TRUE((robot == "r1" ? pose_ : other_pose_)->write(wire));
    bench_.spin();
  }
  template <class Wire>
  int taken(bus::Reader<Wire>& reader) {
    Wire wire;
    int count = 0;
    while (reader.take(wire)) ++count;
    return count;
  }
  int maps() { return taken(*grid_); }
  int contributions() { return taken(*contributions_); }

  test::StageBench bench_;
  std::unique_ptr<bus::Writer<v1::Objects>> objects_ = bench_.bus().writer(bench_.topics.objects, "r1");
  std::unique_ptr<bus::Writer<v1::Pose>> pose_ = bench_.bus().writer(bench_.topics.pose, "r1"),
                                         other_pose_ = bench_.bus().writer(bench_.topics.pose, "r2");
  std::unique_ptr<bus::Reader<v1::Grid>> grid_ = bench_.bus().reader(bench_.topics.map_grid);
  std::unique_ptr<bus::Reader<v1::Contribution>> contributions_ =
      bench_.bus().reader(bench_.topics.map_contribution);
};

class LiveMerger : public MergerFixture {
 protected:
  /// The replica of r2 is not heard, so that of r1 takes the office of publishing after a while.
  LiveMerger() : MergerFixture(bus::RunMode::kLive) {
    const auto elections = bench_.bus().reader(bench_.topics.election);
    const auto begun = std::chrono::steady_clock::now();
    v1::Candidacy candidacy;
    while (candidacy.term() == 0 && std::chrono::steady_clock::now() - begun < std::chrono::seconds(10)) {
      bench_.bus().wait(std::chrono::milliseconds(50));
      bench_.spin();
      elections->take(candidacy);
    }
    EXPECT_EQ(candidacy.term(), 1u);
  }
};

TEST_F(LiveMerger, PublishesInIdleWindow) {
  bench_.idle();
  EXPECT_EQ(maps(), 0);  // no map yet
  int published = 0;
  for (int step = 1; step <= 12; ++step) {
    pose("r2", step);  // other robots may be ahead
    objects(step);
    pose("r1", step);
    EXPECT_EQ(contributions(), 1) << step;
    EXPECT_EQ(maps(), 0) << step;  // frames of other robots may still arrive
    bench_.idle();
    published += maps();
  }
  EXPECT_EQ(published, 4);  // every 1.2 s
}

TEST_F(LiveMerger, PublishesWithoutOwnFrames) {
  for (int step = 1; step <= 2; ++step) {
    objects(step);
    pose("r1", step);
    bench_.idle();
  }
  EXPECT_EQ(contributions(), 2);
  EXPECT_EQ(maps(), 1);  // without the second contribution
  objects(3);            // the localizer is lost: no further pose of r1 arrives
  bench_.idle();
  EXPECT_EQ(maps(), 0);
  pose("r2", 4);
  bench_.idle();
  EXPECT_EQ(maps(), 1);
}

class ReplayedMerger : public MergerFixture {
 protected:
  ReplayedMerger() : MergerFixture(bus::RunMode::kReplay) {}
};

TEST_F(ReplayedMerger, WaitsForRobotsThatMayPublishEarlierPoses) {
  objects(1);
  pose("r1", 1);
  EXPECT_EQ(contributions(), 0);  // an equally old pose of r2 may arrive
  pose("r2", 1);
  EXPECT_EQ(contributions(), 1);
}

TEST_F(ReplayedMerger, DoesNotWaitForRobotWithoutNewPoses) {
  objects(1);
  pose("r2", 1);
  pose("r1", 1);
  EXPECT_EQ(contributions(), 1);
  for (int step = 2; step <= 5; ++step) {
    objects(step);
    pose("r1", step, {{"r2", 1}});
    EXPECT_EQ(contributions(), 1) << step;
  }
}

/// The status keeps only the last message.
TEST_F(ReplayedMerger, LastMessageCountsMapWarnings) {
  for (int step = 1; step <= 4; ++step) {
    objects(step, true);
    pose("r2", step);
    pose("r1", step, {{"r2", step}});
  }
  EXPECT_EQ(bench_.status().last_error, Message{});
  bench_.drain();
  const std::vector<Message> messages = bench_.messages();
  ASSERT_GE(messages.size(), 2u);
  EXPECT_EQ(messages.front().code, ErrorCode::kOutlinesUncertain);
  EXPECT_EQ(messages.back().code, ErrorCode::kMapIncomplete);
  EXPECT_THAT(messages.back().text, testing::HasSubstr("1 group(s) of occupied cells without an outline"));
}

TEST_F(ReplayedMerger, ContributesWhenOwnFramesStartLate) {
  for (int step = 1; step <= 5; ++step) pose("r2", step, {{"r1", 0}});
  objects(6);
  pose("r1", 6, {{"r2", 5}});
  EXPECT_EQ(contributions(), 1);
}

}  // namespace
}  // namespace omnifleet
