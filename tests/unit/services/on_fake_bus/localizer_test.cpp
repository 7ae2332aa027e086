// What the localizer tells people, and what it does in a lull.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "adapters/adapters.h"
#include "fleet/fleet.h"
#include "outline/prism.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kFrame = 200'000'000;

/// One frame of a robot, with nothing in sight yet.
Objects frameOf(const std::string& robot, int step) {
  Objects seen;
  seen.robot = robot;
  seen.acquired_ns = step * kFrame;
  seen.sequence = static_cast<std::uint32_t>(step);
  seen.camera_height_m = 0.5;
  seen.motion.valid = step > 0;
  seen.motion.since_ns = (step - 1) * kFrame;
  seen.motion.covariance = Eigen::Vector3d(1e-8, 1e-8, 1e-8).asDiagonal();
  seen.scan.range_m.assign(360, 1.5F);
  seen.scan.sigma_m.assign(360, 0.01F);
  seen.scan.label.assign(360, RayLabel::kFloorEnd);
  seen.scan.object.assign(360, 0);
  return seen;
}

bool write(bus::Writer<v1::Objects>& writer, const Objects& objects) {
  v1::Objects wire;
  adapters::toWire(objects, adapters::RunClock::kDataset, wire);
  return writer.write(wire);
}

/// Both robots' classifiers are played: they stand, and each sees a thing that the other does
/// not.
class LiveLocalizer : public testing::Test {
 protected:
  LiveLocalizer() {
    for (const char* robot : {"r1", "r2"})
      objects_.emplace_back(robot, bench_.bus().writer(bench_.topics.objects, robot));
  }
  void frames(int step) {
    for (auto& [robot, writer] : objects_) {
      Objects seen = frameOf(robot, step);
      seen.tracks.push_back(bin({0.9, 0.5}));
      ASSERT_TRUE(write(*writer, seen));
    }
    bench_.spin();
  }

  /// Round, 20 cm wide, 15 cm high; base_link.
  static Track bin(const Eigen::Vector2d& at_m) {
    Track track;
    track.id = 1;
    track.kind = ObjectKind::kObstacle;
    track.kind_probability = 1.0;
    track.visible = true;
    track.position_m = at_m;
    track.contact_m = at_m * (1.0 - 0.1 / at_m.norm());
    for (int k = 0; k < 24; ++k) {
      const double angle = 2.0 * M_PI * k / 24;
      track.hull_m.push_back(at_m + 0.1 * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
    outline::PrismView view;
    view.camera_height_m = 0.5;
    track.supports = outline::prismSupports(track.hull_m, 0.15, view, 0.002);
    return track;
  }

  test::StageBench bench_{"localizer", "", "", "", bus::RunMode::kLive};
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::Objects>>>> objects_;
};

/// What is in sight contradicts both starts, frame by frame.
TEST_F(LiveLocalizer, ATroubleThatLastsIsToldOnceOfEachRobot) {
  for (int step = 0; step < 40; ++step) {
    frames(step);
    bench_.lull();
  }
  const std::vector<std::string> told = bench_.problems();
  ASSERT_EQ(told.size(), 2U);
  for (const std::string& line : told) EXPECT_THAT(line, HasSubstr("is its initial_pose right?"));
  EXPECT_NE(told[0], told[1]);
}

TEST_F(LiveLocalizer, TheWindowIsSolvedAnewInALullOnceForEachRoundOfFrames) {
  EXPECT_FALSE(bench_.background());
  for (int step = 0; step < 3; ++step) {
    frames(step);
    EXPECT_TRUE(bench_.background()) << step;
    EXPECT_FALSE(bench_.background()) << step;
  }
}

/// The estimator has died in the middle of a run; the robots drive on, 5 cm a frame, and see nothing.
class Successor : public testing::Test {
 protected:
  static constexpr double kStep_m = 0.05;

  Successor() {
    for (const char* robot : {"r1", "r2"}) {
      objects_.emplace_back(robot, bench_.bus().writer(bench_.topics.objects_kept, robot));
      keyframes_.emplace_back(robot, bench_.bus().writer(bench_.topics.map_keyframe_pose, robot));
      poses_.emplace_back(robot, bench_.bus().reader(bench_.topics.pose, robot));
    }
  }
  void frame(int step) {
    for (auto& [robot, writer] : objects_) {
      Objects seen = frameOf(robot, step);
      seen.motion.previous_from_current = {kStep_m, 0.0, 0.0};
      seen.motion.left_m = seen.motion.right_m = kStep_m;
      ASSERT_TRUE(write(*writer, seen));
    }
  }
  /// What the replicas of the map hold of a robot that drives along +x at this y.
  void keyframe(std::size_t robot, int step, const Pose2& at,
                const Eigen::Vector4d& camera_error = {0, 0, 0, 0}, std::uint32_t term = 0) {
    PoseEstimate pose;
    pose.robot = keyframes_[robot].first;
    pose.acquired_ns = step * kFrame;
    pose.valid = true;
    pose.map_from_base = at;
    pose.camera_error = camera_error;
    v1::KeyframePose wire;
    adapters::toWire(occupancy::makeKeyframePose(pose, term), adapters::RunClock::kDataset, wire);
    ASSERT_TRUE(keyframes_[robot].second->write(wire));
  }
  void end(int steps) {
    std::vector<std::string> streams = {"objects r1", "objects r2"};
    for (const std::string& camera : fleet_.ceilingCameras()) streams.push_back("measurement " + camera);
    const auto ends = bench_.bus().writer(bench_.topics.run_end);
    for (const std::string& stream : streams) {
      v1::RunEnd end;
      end.stream(stream);
      end.header().acquired_ns(steps * kFrame);
      ASSERT_TRUE(ends->write(end));
    }
    bench_.spin();
  }
  /// All that it told since the last call, invalid ones too.
  std::vector<PoseEstimate> told(std::size_t robot) {
    std::vector<PoseEstimate> all;
    v1::Pose wire;
    while (poses_[robot].second->take(wire)) adapters::fromWire(wire, all.emplace_back());
    return all;
  }

  const fleet::Fleet fleet_ = fleet::Fleet::load(
      std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml", "", {});
  test::StageBench bench_{"localizer", "", "", "", bus::RunMode::kLive, 2};
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::Objects>>>> objects_;
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::KeyframePose>>>> keyframes_;
  std::vector<std::pair<std::string, std::unique_ptr<bus::Reader<v1::Pose>>>> poses_;
};

TEST_F(Successor, GoesOnWhereTheMapLastSawTheRobotsAndTellsNoPoseBefore) {
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.spin();
  EXPECT_TRUE(told(0).empty()) << "does not know yet where the robots are";
  keyframe(0, 54, {3.0, 1.0, 0.0});
  keyframe(0, 55, {3.4, 1.0, 0.0});
  keyframe(0, 55, {3.05, 1.0, 0.0}, {0.01, 0, 0, 0}, 1);  // as corrected
  bench_.spin();
  EXPECT_TRUE(told(0).empty()) << "of r2 nothing is known";
  keyframe(1, 57, {-2.0, 0.5, M_PI});
  bench_.spin();
  for (const std::size_t robot : {0U, 1U}) {
    const std::vector<PoseEstimate> poses = told(robot);
    const int first = robot == 0 ? 55 : 57;
    ASSERT_EQ(poses.size(), static_cast<std::size_t>(60 - first)) << "what came before was told already";
    for (const PoseEstimate& pose : poses) {
      const double way_m = kStep_m * static_cast<double>(pose.sequence - static_cast<std::uint32_t>(first));
      EXPECT_TRUE(pose.valid);
      EXPECT_NEAR(pose.map_from_base.x_m, robot == 0 ? 3.05 + way_m : -2.0 - way_m, 1e-3);
      EXPECT_NEAR(pose.map_from_base.y_m, robot == 0 ? 1.0 : 0.5, 1e-3);
      EXPECT_GT(pose.covariance(0, 0), 1e-4) << "not as sure as a start";
      EXPECT_NEAR(pose.camera_error(0), robot == 0 ? 0.01 : 0.0, 1e-9)
          << "what was found of the camera holds";
    }
  }
  EXPECT_TRUE(bench_.problems().empty());
}

/// Replicas tell what they hold from the oldest on.
TEST_F(Successor, WaitsForAPoseFromWhichItsFramesLeadOn) {
  keyframe(0, 20, {1.5, 1.0, 0.0});
  keyframe(1, 57, {-2.0, 0.5, M_PI});
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.spin();
  EXPECT_TRUE(told(0).empty()) << "r1 went on for 30 frames of which nothing is known";
  keyframe(0, 35, {2.25, 1.0, 0.0});
  bench_.spin();
  EXPECT_TRUE(told(0).empty());
  keyframe(0, 55, {3.25, 1.0, 0.0});
  bench_.spin();
  const std::vector<PoseEstimate> poses = told(0);
  ASSERT_EQ(poses.size(), 5U);
  EXPECT_NEAR(poses.front().map_from_base.x_m, 3.25, 1e-3);
}

TEST_F(Successor, IsTheLessSureTheLongerNobodySawTheWay) {
  keyframe(0, 40, {3.0, 1.0, 0.0});
  keyframe(1, 50, {2.0, 0.0, 0.0});
  for (int step = 50; step < 52; ++step) frame(step);
  bench_.spin();
  ASSERT_TRUE(bench_.wakeAt()) << "a later pose of r1 may come";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  const auto r1 = told(0), r2 = told(1);
  ASSERT_EQ(r1.size(), 2U);
  EXPECT_GT(std::sqrt(r1[0].covariance(0, 0)), 0.5) << "two seconds of driving at up to 0.5 m/s, at 1 σ";
  EXPECT_LT(std::sqrt(r2.at(0).covariance(0, 0)), 0.03);
}

TEST_F(Successor, HasNoPoseWhereNobodyKnowsAndSaysSo) {
  for (int step = 60; step < 65; ++step) frame(step);  // older ones may have been kept no more
  bench_.spin();
  EXPECT_TRUE(told(0).empty());
  ASSERT_TRUE(bench_.wakeAt()) << "it listens first";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  for (const PoseEstimate& pose : told(0)) EXPECT_FALSE(pose.valid);
  EXPECT_THAT(bench_.problems(), testing::Contains(HasSubstr("r1: started again, and no replica")));
  EXPECT_TRUE(bench_.succeeded()) << "the run goes on";
  end(65);
  const std::vector<std::string> told_at_end = bench_.problems();
  EXPECT_THAT(told_at_end, testing::Contains(HasSubstr("r2: was never located")));
  EXPECT_THAT(told_at_end, testing::Contains(HasSubstr("no robot was ever located")));
  EXPECT_FALSE(bench_.succeeded());
}

/// It died before anything was mapped: the run has only begun, and the first frames nobody ever had.
TEST_F(Successor, OfRobotsWhoseFirstFrameIsThereTheStartsHold) {
  for (int step = 9; step < 12; ++step) frame(step);
  bench_.spin();
  ASSERT_TRUE(bench_.wakeAt()) << "it listens first";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  const auto poses = told(0);
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_TRUE(poses[0].valid);
  const Pose2 off = fleet_.robots.front().initial_pose->inverse() * poses[2].map_from_base;
  EXPECT_NEAR(off.x_m, 2 * kStep_m, 1e-3);
  EXPECT_NEAR(off.y_m, 0.0, 1e-3);
  end(12);
  EXPECT_TRUE(bench_.problems().empty());
  EXPECT_TRUE(bench_.succeeded());
}

}  // namespace
}  // namespace omnifleet
