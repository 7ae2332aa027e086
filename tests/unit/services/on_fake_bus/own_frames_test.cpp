// The replica that saves the map, with a robot whose poses are in a frame of its own until the localizer
// matches it (topics pose, map/keyframe_pose, alignment and place).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "adapters/adapters.h"
#include "appearance/map_files.h"
#include "common/run_ends.h"
#include "dataset/atomic_file.h"
#include "dataset/merge_file.h"
#include "dataset/trajectory_files.h"
#include "tests/test_data.h"
#include "tests/unit/services/global_merger/place_samples.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr TimeNs kApartStep_ns = 400'000'000;
constexpr adapters::RunClock kApartClock = adapters::RunClock::kDataset;
/// The own frame of r2 lies 2 m beside the common one.
const Pose2 kMapFromOwn{0.0, 2.0, 0.0};

/// The merger of r1. The test plays its classifier, the localizer and the replica of r2.
class OwnFrames : public testing::Test {
 protected:
  explicit OwnFrames(bus::RunMode mode = bus::RunMode::kReplay)
      : bench_("global_merger", "r1", folder_ / "out", "", mode) {}

  static PoseEstimate poseOf(const std::string& robot, int step, bool in_own_frame) {
    PoseEstimate pose;
    pose.robot = robot;
    pose.acquired_ns = step * kApartStep_ns;
    pose.sequence = static_cast<std::uint32_t>(step);
    pose.valid = true;
    pose.state = LocalizationState::kLocalized;
    pose.map_from_base = {0.1 * step, 0.0, 0.0};  // far enough for a keyframe
    if (in_own_frame) {
      pose.frame = robot;
    } else if (robot == "r2") {
      pose.map_from_base = kMapFromOwn * pose.map_from_base;
    }
    pose.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-6).asDiagonal();
    return pose;
  }
  static Objects objectsOf(const std::string& robot, int step) {
    Objects seen;
    seen.robot = robot;
    seen.acquired_ns = step * kApartStep_ns;
    seen.sequence = static_cast<std::uint32_t>(step);
    seen.scan.range_m.assign(360, 0.8F);
    seen.scan.sigma_m.assign(360, 0.01F);
    seen.scan.label.assign(360, RayLabel::kObstacle);
    seen.scan.object.assign(360, 0);
    return seen;
  }
  /// One frame of both robots. r2 is in its own frame or in map.
  void frame(int step, bool r2_in_own_frame) {
    v1::Objects objects;
    adapters::toWire(objectsOf("r1", step), kApartClock, objects);
    ASSERT_TRUE(objects_->write(objects));
    v1::Pose pose;
    adapters::toWire(poseOf("r1", step, false), kApartClock, 0, pose);
    ASSERT_TRUE(pose_r1_->write(pose));
    const PoseEstimate r2 = poseOf("r2", step, r2_in_own_frame);
    adapters::toWire(r2, kApartClock, 0, pose);
    ASSERT_TRUE(pose_r2_->write(pose));
    v1::Contribution contribution;
    adapters::toWire(occupancy::makeContribution(objectsOf("r2", step)), kApartClock, contribution);
    ASSERT_TRUE(contribution_->write(contribution));
    keyframePose(occupancy::makeKeyframePose(r2));
    bench_.spin();
    last_step_ = step;
  }
  void keyframePose(const occupancy::KeyframePose& pose) {
    v1::KeyframePose wire;
    adapters::toWire(pose, kApartClock, wire);
    ASSERT_TRUE(keyframe_pose_->write(wire));
    ++(pose.term == 0 ? first_poses_ : corrections_);
  }
  void alignment(const Alignment& alignment) {
    v1::Alignment wire;
    adapters::toWire(alignment, kApartClock, wire);
    ASSERT_TRUE(alignment_->write(wire));
    bench_.spin();
  }
  void place(const Place& place) {
    v1::Place wire;
    adapters::toWire(place, kApartClock, wire);
    ASSERT_TRUE(places_.at(place.robot)->write(wire));
    bench_.spin();
  }
  static Alignment anchored() {
    return {"r1", 0, AlignmentStatus::kAnchored, "", "initial pose", 1.0, {}, Eigen::Matrix3d::Zero()};
  }
  static Alignment undecided() {
    return {"r2", kApartStep_ns,          AlignmentStatus::kUndecided, "r2", "no shared place", 0.1,
            {},   Eigen::Matrix3d::Zero()};
  }
  static Alignment matched(int step) {
    return {"r2", step * kApartStep_ns, AlignmentStatus::kMatched,         "", "4 shared places",
            0.9,  kMapFromOwn,          1e-6 * Eigen::Matrix3d::Identity()};
  }
  /// The localizer has matched r2: all its poses again, in map.
  void publishAgain(int last_step) {
    for (int step = 1; step <= last_step; ++step)
      keyframePose(occupancy::makeKeyframePose(poseOf("r2", step, false), 1, 1));
    bench_.spin();
  }
  void end(const std::string& stream, TimeNs last_ns, int samples) {
    v1::RunEnd end;
    end.stream(stream);
    adapters::fillHeader(last_ns, 0, kApartClock, end.header());
    end.samples(static_cast<std::uint64_t>(samples));
    ASSERT_TRUE(ends_->write(end));
  }
  /// All inputs end, except what the test has announced before.
  void endRun() {
    const TimeNs last = last_step_ * kApartStep_ns;
    for (const char* stream : {"objects r1", "pose r1", "pose r2", "map/contribution r2"})
      end(stream, last, last_step_);
    end("map/keyframe_pose r2", last, first_poses_);
    end("map/keyframe_pose localizer r1", 0, 0);
    end("map/keyframe_pose localizer r2", last, corrections_);
    bench_.spin();
  }
  std::string file(const std::string& name) const { return folder_ / ("out/" + name); }
  bool exists(const std::string& name) const { return fs::exists(file(name)); }
  /// y of the upper edge of the last published grid.
  double topOfGrid() {
    v1::Grid grid;
    double top_m = -1e9;
    while (grid_->take(grid)) top_m = grid.origin().y() + grid.resolution_m() * grid.height();
    return top_m;
  }

  test::TempFolder folder_;
  test::StageBench bench_;
  std::unique_ptr<bus::Writer<v1::Objects>> objects_ = bench_.bus().writer(bench_.topics.objects, "r1");
  std::unique_ptr<bus::Writer<v1::Pose>> pose_r1_ = bench_.bus().writer(bench_.topics.pose, "r1"),
                                         pose_r2_ = bench_.bus().writer(bench_.topics.pose, "r2");
  std::unique_ptr<bus::Writer<v1::Contribution>> contribution_ =
      bench_.bus().writer(bench_.topics.map_contribution, "r2");
  std::unique_ptr<bus::Writer<v1::KeyframePose>> keyframe_pose_ =
      bench_.bus().writer(bench_.topics.map_keyframe_pose, "r2");
  std::unique_ptr<bus::Writer<v1::Alignment>> alignment_ = bench_.bus().writer(bench_.topics.alignment);
  std::map<std::string, std::unique_ptr<bus::Writer<v1::Place>>> places_ = [this] {
    std::map<std::string, std::unique_ptr<bus::Writer<v1::Place>>> writers;
    for (const char* robot : {"r1", "r2"}) writers[robot] = bench_.bus().writer(bench_.topics.place, robot);
    return writers;
  }();
  std::unique_ptr<bus::Writer<v1::RunEnd>> ends_ = bench_.bus().writer(bench_.topics.run_end);
  std::unique_ptr<bus::Reader<v1::Grid>> grid_ = bench_.bus().reader(bench_.topics.map_grid);
  int last_step_ = 0, first_poses_ = 0, corrections_ = 0;
};

TEST_F(OwnFrames, UnmatchedRobotHasAMapOfItsOwn) {
  alignment(anchored());
  for (int step = 1; step <= 8; ++step) frame(step, true);
  alignment(undecided());
  bench_.drain();
  EXPECT_TRUE(bench_.succeeded());
  // r1 sees 0.8 m far; the walls around r2 would be up to 2.8 m from its path.
  EXPECT_LT(topOfGrid(), 1.0) << "the published map is the common one";
  for (const char* folder : {"trajectories/", "covariances/", "localization/"}) {
    const std::string kind = std::string(folder) == "trajectories/" ? ".tum" : ".csv";
    EXPECT_FALSE(exists(folder + ("r2" + kind))) << folder;
    EXPECT_TRUE(exists(folder + ("r1" + kind))) << folder;
    EXPECT_TRUE(exists(std::string("maps/r2/") + folder + ("r2" + kind))) << folder;
  }
  for (const char* name : {"map.bt", "map.pgm", "map.yaml", "map.png", "objects.geojson"})
    EXPECT_TRUE(exists(std::string("maps/r2/") + name)) << name;
  EXPECT_FALSE(exists("maps/r1"));
  const auto own = dataset::flat(dataset::readTum(file("maps/r2/trajectories/r2.tum")));
  ASSERT_EQ(own.size(), 8U);
  EXPECT_NEAR(own[3].map_from_base.y_m, 0.0, 1e-9);
  EXPECT_EQ(dataset::readFile(file("merge.json")), R"({
  "robots": {
    "r1": {
      "status": "anchored",
      "frame": "map",
      "reason": "initial pose",
      "score": 1.0,
      "map_from_frame": null,
      "sigma": null,
      "time_s": 0.0
    },
    "r2": {
      "status": "undecided",
      "frame": "r2",
      "reason": "no shared place",
      "score": 0.1,
      "map_from_frame": null,
      "sigma": null,
      "time_s": 0.4
    }
  }
}
)");
}

TEST_F(OwnFrames, MatchedRobotIsWhollyInTheCommonMap) {
  for (int step = 1; step <= 6; ++step) frame(step, true);
  EXPECT_LT(topOfGrid(), 1.0);
  alignment(matched(6));
  publishAgain(6);
  for (int step = 7; step <= 8; ++step) frame(step, false);
  endRun();
  EXPECT_GT(topOfGrid(), 2.7) << "the walls around r2, 0.8 m from its path";
  const auto path = dataset::flat(dataset::readTum(file("trajectories/r2.tum")));
  ASSERT_EQ(path.size(), 8U);
  for (const auto& pose : path) EXPECT_NEAR(pose.map_from_base.y_m, 2.0, 1e-9);
  EXPECT_EQ(dataset::readCovariances(file("covariances/r2.csv")).size(), 8U);
  EXPECT_EQ(dataset::readLocalization(file("localization/r2.csv")).size(), 8U);
  EXPECT_FALSE(exists("maps"));
  const auto merge = dataset::readMerge(file("merge.json"));
  EXPECT_EQ(merge.at("r2").status, AlignmentStatus::kMatched);
  EXPECT_EQ(merge.at("r2").map_from_frame->vector(), kMapFromOwn.vector());
  EXPECT_EQ(merge.at("r1").status, AlignmentStatus::kAnchored);
  EXPECT_THAT(merge.at("r1").reason, HasSubstr("the localizer reported no alignment"));
}

class LiveOwnFrames : public OwnFrames {
 protected:
  LiveOwnFrames() : OwnFrames(bus::RunMode::kLive) {}
};

TEST_F(LiveOwnFrames, SavesTheMapOfAnUnmatchedRobotWhenStopped) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  bench_.idle();
  bench_.drain();
  EXPECT_TRUE(exists("maps/r2/map.bt"));
  EXPECT_FALSE(exists("trajectories/r2.tum"));
  EXPECT_EQ(dataset::readMerge(file("merge.json")).at("r2").status, AlignmentStatus::kUndecided);
}

/// Topics have no common order: the localizer announces its last alignment, and the merger waits for it.
TEST_F(OwnFrames, WaitsForTheLastAlignmentThatIsAnnounced) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  alignment(undecided());
  publishAgain(4);
  end("alignment r2", 4 * kApartStep_ns, 2);
  endRun();
  EXPECT_FALSE(exists("merge.json")) << "the last sample has not arrived";
  alignment(matched(4));
  ASSERT_TRUE(exists("merge.json"));
  EXPECT_EQ(dataset::readMerge(file("merge.json")).at("r2").status, AlignmentStatus::kMatched);
}

TEST_F(OwnFrames, IgnoresAlignmentThatIsNotFinite) {
  for (int step = 1; step <= 2; ++step) frame(step, true);
  Alignment broken = matched(2);
  broken.map_from_frame.x_m = std::nan("");
  alignment(undecided());
  end("alignment r2", 2 * kApartStep_ns, 2);
  alignment(broken);
  endRun();
  ASSERT_TRUE(exists("merge.json")) << "a rejected sample must not delay the save";
  EXPECT_EQ(dataset::readMerge(file("merge.json")).at("r2").status, AlignmentStatus::kUndecided);
  EXPECT_EQ(bench_.status().drops, 1U);
}

TEST_F(OwnFrames, PlacesAreInTheFolderOfTheirMap) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  for (std::uint32_t i = 0; i < 3; ++i) {
    place(test::somePlace("r1", i));
    place(test::somePlace("r2", i, "r2"));
  }
  endRun();
  EXPECT_EQ(appearance::loadMap(file("places/r1.g2o")).places.size(), 3U);
  const auto own = appearance::loadMap(file("maps/r2/places/r2.g2o"));
  EXPECT_EQ(own.frame, "r2");
  EXPECT_EQ(own.places.size(), 3U);
  EXPECT_FALSE(exists("places/r2.g2o"));
}

TEST_F(OwnFrames, PlacesOfAMatchedRobotMoveIntoTheCommonFolder) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  for (std::uint32_t i = 0; i < 3; ++i) place(test::somePlace("r2", i, "r2"));
  alignment(matched(4));
  publishAgain(4);
  for (std::uint32_t i = 0; i < 3; ++i) place(test::somePlace("r2", i, "", kMapFromOwn.y_m));
  endRun();
  const test::G2oGraph graph = test::readG2o(file("places/r2.g2o"));
  ASSERT_EQ(graph.vertices.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(graph.vertices[i].second.y(), 2.0 + 0.02 * static_cast<double>(i), 1e-12);
  EXPECT_FALSE(exists("maps"));
}

TEST_F(OwnFrames, WaitsForTheLastPlaceThatIsAnnounced) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  place(test::somePlace("r1", 0));
  end("place r1", 4 * kApartStep_ns, 2);
  endRun();
  EXPECT_FALSE(exists("places/r1.g2o")) << "the last sample has not arrived";
  place(test::somePlace("r1", 1));
  ASSERT_TRUE(exists("places/r1.g2o"));
  EXPECT_EQ(test::readG2o(file("places/r1.g2o")).vertices.size(), 2U);
}

TEST_F(LiveOwnFrames, SavesPlacesWhenStopped) {
  for (int step = 1; step <= 4; ++step) frame(step, true);
  place(test::somePlace("r1", 0));
  place(test::somePlace("r2", 0, "r2"));
  bench_.idle();
  bench_.drain();
  EXPECT_TRUE(exists("places/r1.g2o"));
  EXPECT_TRUE(exists("maps/r2/places/r2.g2o"));
}

}  // namespace
}  // namespace omnifleet
