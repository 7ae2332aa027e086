// Messages of the localizer, its idle window, and its state recovery after a restart.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "adapters/adapters.h"
#include "fleet/fleet.h"
#include "outline/prism.h"
#include "tests/test_data.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

MATCHER_P2(IsMessage, code, text, "") {
  return arg.code == code && arg.text.find(text) != std::string::npos;
}

constexpr TimeNs kFrame = 200'000'000;

/// One frame of a robot without objects.
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

/// The test plays the classifiers of both robots. The robots stand still, and each sees an obstacle that the
/// other one does not see.
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

  /// An obstacle of 20 cm diameter and 15 cm height, in base_link.
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

/// The observations contradict both initial poses in every frame.
TEST_F(LiveLocalizer, ReportsLastingContradictionOncePerRobot) {
  for (int step = 0; step < 40; ++step) {
    frames(step);
    bench_.idle();
  }
  const std::vector<Message> messages = bench_.messages();
  ASSERT_EQ(messages.size(), 2U);
  for (const Message& message : messages) EXPECT_EQ(message.code, ErrorCode::kInitialPoseRejected);
  EXPECT_NE(messages[0].text, messages[1].text);
}

TEST_F(LiveLocalizer, SolvesWindowInIdleTimeOncePerRoundOfFrames) {
  EXPECT_FALSE(bench_.background());
  for (int step = 0; step < 3; ++step) {
    frames(step);
    EXPECT_TRUE(bench_.background()) << step;
    EXPECT_FALSE(bench_.background()) << step;
  }
}

/// The estimator was restarted in the middle of a run. The robots continue to drive, 5 cm per frame, and see
/// no object.
class RestartedLocalizer : public testing::Test {
 protected:
  static constexpr double kStep_m = 0.05;

  /// @param fleet_file empty: config/fleets/small.yaml
  explicit RestartedLocalizer(const std::string& fleet_file = {})
      : fleet_(fleet::Fleet::load(fleet_file.empty() ? std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) +
                                                           "/config/fleets/small.yaml"
                                                     : fleet_file,
                                  "", {})),
        bench_("localizer", "", "", fleet_file, bus::RunMode::kLive, 2) {
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
  /// Keyframe poses as the replicas of the map hold them. @param frame empty: map
  void keyframe(std::size_t robot, int step, const Pose2& at,
                const Eigen::Vector4d& camera_error = {0, 0, 0, 0}, std::uint32_t term = 0,
                const std::string& frame = {}) {
    PoseEstimate pose;
    pose.robot = keyframes_[robot].first;
    pose.acquired_ns = step * kFrame;
    pose.valid = true;
    pose.frame = frame;
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
  /// All poses since the last call, including invalid ones.
  std::vector<PoseEstimate> published(std::size_t robot) {
    std::vector<PoseEstimate> all;
    v1::Pose wire;
    while (poses_[robot].second->take(wire)) adapters::fromWire(wire, all.emplace_back());
    return all;
  }

  const fleet::Fleet fleet_;
  test::StageBench bench_;
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::Objects>>>> objects_;
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::KeyframePose>>>> keyframes_;
  std::vector<std::pair<std::string, std::unique_ptr<bus::Reader<v1::Pose>>>> poses_;
};

TEST_F(RestartedLocalizer, ContinuesFromLastMappedPoses) {
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.spin();
  EXPECT_TRUE(published(0).empty()) << "the poses of the robots are not known yet";
  keyframe(0, 54, {3.0, 1.0, 0.0});
  keyframe(0, 55, {3.4, 1.0, 0.0});
  keyframe(0, 55, {3.05, 1.0, 0.0}, {0.01, 0, 0, 0}, 1);  // a correction with a newer term
  bench_.spin();
  EXPECT_TRUE(published(0).empty()) << "the pose of r2 is not known yet";
  keyframe(1, 57, {-2.0, 0.5, M_PI});
  bench_.spin();
  for (const std::size_t robot : {0U, 1U}) {
    const std::vector<PoseEstimate> poses = published(robot);
    const int first = robot == 0 ? 55 : 57;
    ASSERT_EQ(poses.size(), static_cast<std::size_t>(60 - first))
        << "earlier poses were published before the restart";
    for (const PoseEstimate& pose : poses) {
      const double driven_m =
          kStep_m * static_cast<double>(pose.sequence - static_cast<std::uint32_t>(first));
      EXPECT_TRUE(pose.valid);
      EXPECT_NEAR(pose.map_from_base.x_m, robot == 0 ? 3.05 + driven_m : -2.0 - driven_m, 1e-3);
      EXPECT_NEAR(pose.map_from_base.y_m, robot == 0 ? 1.0 : 0.5, 1e-3);
      EXPECT_GT(pose.covariance(0, 0), 1e-4) << "less certain than an initial pose";
      EXPECT_NEAR(pose.camera_error(0), robot == 0 ? 0.01 : 0.0, 1e-9)
          << "the estimated camera error must be kept";
    }
  }
  EXPECT_TRUE(bench_.messages().empty());
}

/// Replicas publish their content from the oldest entry on.
TEST_F(RestartedLocalizer, WaitsForPoseThatPrecedesItsFrames) {
  keyframe(0, 20, {1.5, 1.0, 0.0});
  keyframe(1, 57, {-2.0, 0.5, M_PI});
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.spin();
  EXPECT_TRUE(published(0).empty()) << "the motion of r1 in 30 frames is unknown";
  keyframe(0, 35, {2.25, 1.0, 0.0});
  bench_.spin();
  EXPECT_TRUE(published(0).empty());
  keyframe(0, 55, {3.25, 1.0, 0.0});
  bench_.spin();
  const std::vector<PoseEstimate> poses = published(0);
  ASSERT_EQ(poses.size(), 5U);
  EXPECT_NEAR(poses.front().map_from_base.x_m, 3.25, 1e-3);
}

TEST_F(RestartedLocalizer, UncertaintyGrowsWithUnobservedTime) {
  keyframe(0, 40, {3.0, 1.0, 0.0});
  keyframe(1, 50, {2.0, 0.0, 0.0});
  for (int step = 50; step < 52; ++step) frame(step);
  bench_.spin();
  ASSERT_TRUE(bench_.wakeAt()) << "a later pose of r1 may arrive";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  const auto r1 = published(0), r2 = published(1);
  ASSERT_EQ(r1.size(), 2U);
  EXPECT_GT(std::sqrt(r1[0].covariance(0, 0)), 0.5) << "2 s of driving at up to 0.5 m/s, at 1 σ";
  EXPECT_LT(std::sqrt(r2.at(0).covariance(0, 0)), 0.03);
}

TEST_F(RestartedLocalizer, ReportsRobotsWithoutKnownPose) {
  for (int step = 60; step < 65; ++step) frame(step);  // older frames may no longer be in the history
  bench_.spin();
  EXPECT_TRUE(published(0).empty());
  ASSERT_TRUE(bench_.wakeAt()) << "it must wait for replicas first";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  for (const PoseEstimate& pose : published(0)) EXPECT_FALSE(pose.valid);
  EXPECT_THAT(bench_.messages(), testing::Contains(IsMessage(ErrorCode::kNotLocalized, "r1: no replica")));
  EXPECT_TRUE(bench_.succeeded()) << "the run continues";
  end(65);
  const std::vector<Message> at_end = bench_.messages();
  EXPECT_THAT(at_end, testing::Contains(IsMessage(ErrorCode::kNotLocalized, "r2: never localized")));
  EXPECT_THAT(at_end, testing::Contains(IsMessage(ErrorCode::kNotLocalized, "no robot was ever localized")));
  EXPECT_FALSE(bench_.succeeded());
}

/// The localizer failed before the first map contribution. The run has just begun, and the first frames never
/// arrived.
TEST_F(RestartedLocalizer, UsesInitialPosesEarlyInRun) {
  for (int step = 9; step < 12; ++step) frame(step);
  bench_.spin();
  ASSERT_TRUE(bench_.wakeAt()) << "it must wait for replicas first";
  std::this_thread::sleep_until(*bench_.wakeAt());
  bench_.spin();
  const auto poses = published(0);
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_TRUE(poses[0].valid);
  const Pose2 off = fleet_.robots.front().initial_pose->inverse() * poses[2].map_from_base;
  EXPECT_NEAR(off.x_m, 2 * kStep_m, 1e-3);
  EXPECT_NEAR(off.y_m, 0.0, 1e-3);
  end(12);
  EXPECT_TRUE(bench_.messages().empty());
  EXPECT_TRUE(bench_.succeeded());
}

/// As above, but r2 has no initial pose and maps in a frame of its own.
class RestartedWithOwnFrame : public RestartedLocalizer {
 protected:
  RestartedWithOwnFrame() : RestartedLocalizer(fleetFile()) {
    for (const char* robot : {"r1", "r2"})
      alignments_.push_back(bench_.bus().reader(bench_.topics.alignment, robot));
  }
  static std::string fleetFile() {
    static const test::TempFolder folder;
    std::ofstream(folder / "arena.yaml")
        << "frames: {rate_hz: 5, duration_s: 3}\n"
           "floor: {size_m: [4.0, 3.0]}\n"
           "robots:\n"
           "  r1: {initial_pose: [-0.4, 0.0, 0.0]}\n"
           "  r2: {initial_pose: [-1.1, 0.05, 0.0], initial_pose_known: false}\n"
           "rigs:\n"
           "  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 480, "
           "image_height: 360, focal_px: 111.494, principal_point_px: [239.5, 179.5], fov_deg: 185, "
           "position_m: [0, 0, 0.5]}\n";
    std::ofstream(folder / "fleet.yaml") << "world: {arena: arena.yaml}\n";
    return folder / "fleet.yaml";
  }
  std::vector<Alignment> alignments(std::size_t robot) {
    std::vector<Alignment> all;
    v1::Alignment wire;
    while (alignments_[robot]->take(wire)) adapters::fromWire(wire, all.emplace_back());
    return all;
  }
  std::vector<std::unique_ptr<bus::Reader<v1::Alignment>>> alignments_;
};

TEST_F(RestartedWithOwnFrame, ContinuesThereWithoutAPlaceInMap) {
  const Pose2 last{0.6, 0.2, 0.5};
  keyframe(0, 57, {3.0, 1.0, 0.0});
  keyframe(1, 57, last, {0, 0, 0, 0}, 0, "r2");
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.idle();
  const std::vector<PoseEstimate> in_map = published(0), own = published(1);
  ASSERT_EQ(in_map.size(), 3U);
  ASSERT_EQ(own.size(), 3U) << "earlier poses were published before the restart";
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(in_map[k].frame, "");
    ASSERT_TRUE(own[k].valid);
    EXPECT_EQ(own[k].frame, "r2");
    const Pose2 expected = last * Pose2{kStep_m * static_cast<double>(k), 0.0, 0.0};
    EXPECT_LT((expected.vector() - own[k].map_from_base.vector()).norm(), 1e-3) << k;
  }
  const std::vector<Alignment> reported = alignments(1);
  ASSERT_FALSE(reported.empty());
  for (const Alignment& alignment : reported) {
    EXPECT_EQ(alignment.status, AlignmentStatus::kUndecided);
    EXPECT_EQ(alignment.frame, "r2");
  }
  EXPECT_TRUE(bench_.messages().empty());
}

/// The localizer before it has matched r2. Readers keep the alignments that it published.
TEST_F(RestartedWithOwnFrame, AMatchedRobotContinuesInMap) {
  keyframe(0, 57, {3.0, 1.0, 0.0});
  keyframe(1, 57, {0.6, 0.2, 0.5}, {0, 0, 0, 0}, 0, "r2");
  keyframe(1, 57, {-2.0, 0.5, M_PI}, {0, 0, 0, 0}, 1);
  for (int step = 50; step < 60; ++step) frame(step);
  bench_.idle();
  const std::vector<PoseEstimate> poses = published(1);
  ASSERT_EQ(poses.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    ASSERT_TRUE(poses[k].valid);
    EXPECT_EQ(poses[k].frame, "");
    EXPECT_NEAR(poses[k].map_from_base.x_m, -2.0 - kStep_m * static_cast<double>(k), 1e-3);
    EXPECT_NEAR(poses[k].map_from_base.y_m, 0.5, 1e-3);
  }
  EXPECT_TRUE(alignments(1).empty()) << "it is not anchored: its relation to map was matched";
  EXPECT_TRUE(alignments(0).empty()) << "its initial pose still defines its frame";
  EXPECT_TRUE(bench_.messages().empty());
}

/// Live, under two ceiling cameras: r1 has a forward camera and no wheels. It drives 4 cm per frame.
class LocalizerUnderCeilingCameras : public testing::Test {
 protected:
  static Pose2 truth(int step) { return {0.04 * step, 0.0, 0.0}; }
  void frame(int step) {
    Objects seen = frameOf("r1", step);
    seen.motion = {};
    // Walls of a square room, which a match would locate to millimetres.
    const Pose2 at = truth(step);
    for (int i = 0; i < 720; ++i) {
      const double bearing = 2.0 * M_PI * i / 720;
      const double x = std::cos(bearing), y = std::sin(bearing);
      const double wall_x = std::abs(x) / (x > 0.0 ? 1.0 - at.x_m : 1.0 + at.x_m);
      seen.boundary.inverse_m.push_back(static_cast<float>(std::max(wall_x, std::abs(y) / 0.8)));
      seen.boundary.sigma.push_back(0.003F);
    }
    ASSERT_TRUE(write(*objects_, seen));
    bench_.spin();
  }
  /// Both cameras report; c1 sees r1.
  void measure(int step) {
    const TimeNs time_ns = step * kFrame;
    Measurement pose;
    pose.source = "ceiling/c1";
    pose.kind = MeasurementKind::kAbsolutePose;
    pose.to = "r1";
    pose.acquired_ns = time_ns;
    pose.value = truth(step).vector();
    pose.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
    const auto sequence = static_cast<std::uint32_t>(step);
    v1::Measurement wire;
    adapters::toWire("ceiling/c1", time_ns, sequence, FrameState::kOk, {pose}, adapters::RunClock::kDataset,
                     wire);
    ASSERT_TRUE(c1_->write(wire));
    adapters::toWire("ceiling/c2", time_ns, sequence, FrameState::kOk, {}, adapters::RunClock::kDataset,
                     wire);
    ASSERT_TRUE(c2_->write(wire));
    bench_.spin();
  }
  std::optional<PoseEstimate> published() {
    v1::Pose wire;
    PoseEstimate pose;
    if (!poses_->take(wire) || !adapters::fromWire(wire, pose)) return std::nullopt;
    return pose;
  }

  test::StageBench bench_{"localizer", "", "",
                          std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/ahmed.yaml",
                          bus::RunMode::kLive};
  std::unique_ptr<bus::Writer<v1::Objects>> objects_ = bench_.bus().writer(bench_.topics.objects, "r1");
  std::unique_ptr<bus::Writer<v1::Measurement>> c1_ =
      bench_.bus().writer(bench_.topics.measurement, "ceiling/c1");
  std::unique_ptr<bus::Writer<v1::Measurement>> c2_ =
      bench_.bus().writer(bench_.topics.measurement, "ceiling/c2");
  std::unique_ptr<bus::Reader<v1::Pose>> poses_ = bench_.bus().reader(bench_.topics.pose, "r1");
};

TEST_F(LocalizerUnderCeilingCameras, AFrameWaitsForTheMeasurementOfItsTime) {
  measure(0);
  frame(0);
  ASSERT_TRUE(published());
  for (int step = 1; step < 5; ++step) {
    frame(step);
    EXPECT_FALSE(published()) << step << ": its place is not known yet";
    EXPECT_TRUE(bench_.wakeAt());
    measure(step);
    const auto pose = published();
    ASSERT_TRUE(pose) << step;
    EXPECT_LT((pose->map_from_base.translation() - truth(step).translation()).norm(), 0.002);
  }
}

// The cameras fail. The frame is not delayed for long, and scans of forward cameras do not locate r1.
TEST_F(LocalizerUnderCeilingCameras, WithoutAMeasurementTheCovarianceGrows) {
  for (int step = 0; step < 3; ++step) {
    measure(step);
    frame(step);
    ASSERT_TRUE(published());
  }
  frame(3);
  ASSERT_TRUE(bench_.wakeAt());
  std::this_thread::sleep_until(*bench_.wakeAt());  // the wait itself is the subject
  bench_.spin();
  const auto pose = published();
  ASSERT_TRUE(pose);
  EXPECT_GT(std::sqrt(pose->covariance(0, 0)), 0.05) << "0.5 m/s for 0.2 s";
}

}  // namespace
}  // namespace omnifleet
