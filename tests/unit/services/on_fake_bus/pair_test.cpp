// Two robots in one room, the second one without initial pose: the localizer and the mergers of both on the
// fake bus. The test plays the classifiers: scans are exact intersections with noise, wheels err by 3 %,
// signatures are those of a room with the same walls.

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "adapters/adapters.h"
#include "appearance/map_files.h"
#include "appearance/stored_signature.h"
#include "dataset/merge_file.h"
#include "dataset/trajectory_files.h"
#include "fleet_in_process/in_process.h"
#include "tests/test_data.h"
#include "tests/unit/appearance/textured_room.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet {
namespace {

constexpr TimeNs kPairPeriod_ns = 200'000'000;
constexpr int kPairFrames = 60;
constexpr double kPairStep_m = 0.06, kPairTurn_rad = 0.08;

/// A circle of 0.75 m in the room, from some place on it.
std::vector<Pose2> circleFrom(double from_rad) {
  const Pose2 centre{0.2, -0.45, 0.0};
  std::vector<Pose2> path{centre * Pose2{0.75 * std::sin(from_rad), -0.75 * std::cos(from_rad), from_rad}};
  for (int i = 1; i < kPairFrames; ++i) path.push_back(path.back() * Pose2{kPairStep_m, 0.0, kPairTurn_rad});
  return path;
}

/// What the classifiers of both robots publish.
class PairInRoom {
 public:
  const std::vector<Pose2>& path(const std::string& robot) const { return robot == "r1" ? first_ : second_; }

  Objects frame(const std::string& robot, int i) {
    const Pose2& pose = path(robot)[static_cast<std::size_t>(i)];
    Objects seen;
    seen.robot = robot;
    seen.acquired_ns = (i + 1) * kPairPeriod_ns;
    seen.sequence = static_cast<std::uint32_t>(i);
    seen.camera_height_m = 0.5;
    seen.boundary = room_.scan(pose, 0.003, random_);
    for (int k = 0; k < 360; ++k) {
      const double bearing = pose.theta_rad + 2.0 * M_PI * k / 360;
      const double range_m = room_.range(pose.translation(), {std::cos(bearing), std::sin(bearing)});
      seen.scan.range_m.push_back(static_cast<float>(range_m));
    }
    seen.scan.sigma_m.assign(360, 0.01F);
    seen.scan.label.assign(360, RayLabel::kObstacle);
    seen.scan.object.assign(360, 0);
    addMotion(i, seen.motion);
    seen.appearance.format = maker_.format();
    if (i % 2 == 0)
      seen.appearance.signature = appearance::store(maker_.compute(walls_.panorama(pose, panorama_)));
    return seen;
  }

 private:
  static void addMotion(int i, Motion& motion) {
    motion.since_ns = i * kPairPeriod_ns;
    motion.valid = i > 0;
    if (i == 0) return;
    motion.previous_from_current = {1.03 * kPairStep_m, 0.0, 0.97 * kPairTurn_rad};
    motion.covariance = Eigen::Vector3d(1e-5, 1e-5, 1e-5).asDiagonal();
    motion.left_m = motion.right_m = kPairStep_m;
  }

  std::vector<Pose2> first_ = circleFrom(0.0), second_ = circleFrom(2.5);
  scan::testing::Scene room_ = scan::testing::furnishedRoom();
  test::TexturedRoom walls_{3, {2.5, 2.0}};
  appearance::PanoramaOptions panorama_;
  appearance::SignatureMaker maker_{test::roomUnwrapper(), {}};
  std::mt19937 random_{5};
};

/// A fleet of r1, whose initial pose is the first of its path, and r2 without one.
std::string pairFleet(const test::TempFolder& folder, const Pose2& first) {
  const std::string fleet = folder / "fleet.yaml";
  std::ofstream(folder / "arena.yaml")
      << "name: pair\nframes: {rate_hz: 5, duration_s: 12}\nfloor: {size_m: [5.0, 4.0]}\nrobots:\n  r1: "
         "{initial_pose: ["
      << first.x_m << ", " << first.y_m << ", " << first.theta_rad
      << "], speeds: [0, 0.3, 0.3]}\n"
         "  r2: {initial_pose: [-1.0, 1.0, 0.0], initial_pose_known: false, speeds: [0, 0.3, 0.3]}\n"
         "obstacles:\n  - {kind: box, pose: [2.2, 1.7, 0], size_m: [0.2, 0.2], height_m: 0.2}\n"
         "rigs:\n  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 480, image_height: "
         "360,\n    focal_px: 111.494, principal_point_px: [239.5, 179.5], fov_deg: 185, position_m: [0, 0, "
         "0.5]}\n";
  std::ofstream(fleet) << "name: pair\nworld: {arena: arena.yaml, seed: 1}\n";
  return fleet;
}

/// The localizer and the mergers of both robots.
class PairStages {
 public:
  PairStages(const std::string& fleet, const std::string& out) {
    add("localizer", "", fleet, out);
    add("global_merger", "r1", fleet, out);
    add("global_merger", "r2", fleet, out);
  }
  bus::Bus& bus() { return *test_bus_; }
  void spin() {
    for (bool moved = true; moved;) {
      moved = false;
      for (auto& stage : stages_) {
        while (stage->spin()) moved = true;
      }
    }
  }
  /// Whether all have saved their results.
  bool end() {
    bool all = true;
    for (auto& stage : stages_) {
      all = all && stage->finished();
      stage->drain();
      all = all && stage->succeeded();
    }
    return all;
  }

 private:
  void add(const std::string& service, const std::string& robot, const std::string& fleet,
           const std::string& out) {
    bus::ServiceOptions options;
    options.fleet = fleet;
    options.robot = robot;
    options.out = out;
    options.mode = bus::RunMode::kLockstep;
    buses_.push_back(bus::makeFakeBus(network_));
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>());
    stages_.push_back(
        services::factoryOf(service)({*buses_.back(), options, bus::Topics(bus::RunMode::kLockstep), log}));
    stages_.back()->start();
  }

  std::shared_ptr<bus::FakeNetwork> network_ = bus::makeFakeNetwork();
  std::unique_ptr<bus::Bus> test_bus_ = bus::makeFakeBus(network_);
  std::vector<std::unique_ptr<bus::Bus>> buses_;
  std::vector<std::unique_ptr<bus::Service>> stages_;
};

/// A whole run, once for all tests.
class PairOfRobots : public ::testing::Test {
 protected:
  static constexpr double kPosition_m = 0.05, kHeading_rad = 0.03;

  static void SetUpTestSuite() {
    folder_ = new test::TempFolder;
    pair_ = new PairInRoom;
    drive();
  }
  static void TearDownTestSuite() {
    delete pair_;
    delete folder_;
  }

  static void drive() {
    const bus::Topics topics(bus::RunMode::kLockstep);
    PairStages stages(pairFleet(*folder_, pair_->path("r1").front()), *folder_ / "out");
    const auto ends = stages.bus().writer(topics.run_end);
    const auto alignments = stages.bus().reader(topics.alignment);
    const auto poses = stages.bus().reader(topics.pose, "r2");
    std::map<std::string, std::unique_ptr<bus::Writer<v1::Objects>>> objects;
    for (const char* robot : {"r1", "r2"}) objects[robot] = stages.bus().writer(topics.objects, robot);
    const auto read = [&] {
      v1::Alignment alignment;
      while (alignments->take(alignment)) {
        if (Alignment& a = alignments_.emplace_back(); !adapters::fromWire(alignment, a) || a.robot != "r2")
          alignments_.pop_back();
      }
      v1::Pose pose;
      while (poses->take(pose)) frames_.push_back(pose.frame().to_string());
    };
    for (int i = 0; i < kPairFrames; ++i) {
      for (auto& [robot, writer] : objects) {
        v1::Objects wire;
        adapters::toWire(pair_->frame(robot, i), adapters::RunClock::kDataset, wire);
        ASSERT_TRUE(writer->write(wire));
      }
      stages.spin();
      read();
    }
    for (const auto& [robot, writer] : objects) {
      v1::RunEnd end;
      end.stream("objects " + robot);
      adapters::fillHeader(kPairFrames * kPairPeriod_ns, 0, adapters::RunClock::kDataset, end.header());
      end.samples(kPairFrames);
      ASSERT_TRUE(ends->write(end));
    }
    stages.spin();
    read();
    complete_ = stages.end();
  }

  static std::string file(const std::string& name) { return *folder_ / ("out/" + name); }
  /// Truth of r2 by the number of its frame.
  static const Pose2& truth(std::size_t i) { return pair_->path("r2").at(i); }
  static void expectNear(const Pose2& got, const Pose2& expected, const std::string& where) {
    const Pose2 off = expected.inverse() * got;
    EXPECT_LT(off.translation().norm(), kPosition_m) << where;
    EXPECT_LT(std::abs(off.theta_rad), kHeading_rad) << where;
  }

  static inline test::TempFolder* folder_ = nullptr;
  static inline PairInRoom* pair_ = nullptr;
  static inline std::vector<Alignment> alignments_;  ///< of r2
  static inline std::vector<std::string> frames_;    ///< of its poses
  static inline bool complete_ = false;
};

TEST_F(PairOfRobots, AlignmentIsPublishedAndSaved) {
  EXPECT_TRUE(complete_);
  ASSERT_FALSE(alignments_.empty());
  EXPECT_EQ(alignments_.back().status, AlignmentStatus::kMatched) << alignments_.back().reason;
  expectNear(alignments_.back().map_from_frame, truth(0), "topic alignment");
  const auto merge = dataset::readMerge(file("merge.json"));
  ASSERT_EQ(merge.size(), 2U);
  EXPECT_EQ(merge.at("r1").status, AlignmentStatus::kAnchored);
  EXPECT_EQ(merge.at("r2").status, AlignmentStatus::kMatched);
  EXPECT_TRUE(merge.at("r2").isInMap());
  ASSERT_TRUE(merge.at("r2").map_from_frame);
  expectNear(*merge.at("r2").map_from_frame, truth(0), "merge.json");
}

TEST_F(PairOfRobots, PosesBeginInAFrameOfTheirOwn) {
  ASSERT_EQ(frames_.size(), static_cast<std::size_t>(kPairFrames));
  EXPECT_EQ(frames_.front(), "r2");
  EXPECT_EQ(frames_.back(), "");
}

TEST_F(PairOfRobots, AllPosesAreSavedInMap) {
  const auto path = dataset::flat(dataset::readTum(file("trajectories/r2.tum")));
  ASSERT_EQ(path.size(), static_cast<std::size_t>(kPairFrames)) << "those before the match as well";
  for (std::size_t i = 0; i < path.size(); ++i)
    expectNear(path[i].map_from_base, truth(i), "frame " + std::to_string(i));
  EXPECT_FALSE(std::filesystem::exists(file("maps"))) << "no map of its own is left";
}

TEST_F(PairOfRobots, PlacesAreSavedInMap) {
  const auto map = appearance::loadMap(file("places/r2.g2o"));
  EXPECT_EQ(map.frame, "");
  // Every second frame has a signature, those in the window of the robot's own estimator at the match as
  // well.
  EXPECT_GE(map.places.size(), kPairFrames / 2U);
  EXPECT_EQ(map.places.back().sequence, kPairFrames - 1U);
  for (const Place& place : map.places)
    expectNear(place.frame_from_base, truth(place.sequence),
               "place of image " + std::to_string(place.sequence));
}

}  // namespace
}  // namespace omnifleet
