// Pairs without a common initial pose: what is equal and what differs in one room, in look-alike rooms and in
// unlike rooms, and what the recording says about it.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "dataset/map_files.h"
#include "tests/raycast/room_pair.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

FurnishedOptions ofPair(unsigned seed) {
  FurnishedOptions options;
  options.seed = seed;
  options.frames = 60;
  options.width_px = 64;
  options.height_px = 48;
  options.fast = true;
  options.decorated = seed % 2 == 1;
  return options;
}

bool isPanelEqual(const Panel& a, const Panel& b) {
  return a.normal == b.normal && a.begin_m == b.begin_m && a.end_m == b.end_m && a.bottom_m == b.bottom_m &&
         a.top_m == b.top_m && a.albedo == b.albedo && a.stripe_m == b.stripe_m;
}

bool isWallEqual(const Solid& a, const Solid& b) {
  return a.map_from_solid.vector() == b.map_from_solid.vector() && a.size_m == b.size_m &&
         a.height_m == b.height_m && a.albedo == b.albedo && a.chequered == b.chequered &&
         std::equal(a.panels.begin(), a.panels.end(), b.panels.begin(), b.panels.end(), isPanelEqual);
}

/// Two pieces of the same kind at the same place: an edge of one is within 10 cm of the other's everywhere.
bool isAlike(const Solid& a, const Solid& b) {
  return (a.map_from_solid.translation() - b.map_from_solid.translation()).norm() < 0.1 &&
         (a.size_m - b.size_m).norm() < 0.1 && std::abs(a.height_m - b.height_m) < 0.1;
}

TEST(RoomPair, SharesRoomAndPosesIfSame) {
  double least = 1.0, most = 0.0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    FurnishedOptions options = ofPair(seed);
    options.frames = 120;
    const FurnishedPair pair = furnishedPair(PairKind::kSame, options);
    const Room &one = pair.scenes[0].room, &two = pair.scenes[1].room;
    ASSERT_EQ(one.solids.size(), two.solids.size());
    for (std::size_t k = 0; k < one.solids.size(); ++k)
      EXPECT_TRUE(isWallEqual(one.solids[k], two.solids[k])) << "seed " << seed;
    const std::vector<DriveFrame>& frames = pair.scenes[0].drive.frames;
    const Pose2 apart = frames.front().poses[0].inverse() * frames.front().poses[1];
    EXPECT_GT(apart.translation().norm(), 1.5) << "seed " << seed;
    EXPECT_GT(std::abs(wrapAngle(apart.theta_rad)), M_PI / 4.0 - 1e-9) << "seed " << seed;
    ASSERT_TRUE(pair.map_from_r2);
    EXPECT_EQ(pair.map_from_r2->vector(), frames.front().poses[1].vector());
    for (std::size_t k = 0; k < frames.size(); ++k)
      EXPECT_EQ(frames[k].poses[1].vector(), pair.scenes[1].drive.frames[k].poses[1].vector());
    EXPECT_LT(std::abs(two.light / one.light - 1.0), 0.15 + 1e-9);
    least = std::min(least, pair.overlap);
    most = std::max(most, pair.overlap);
  }
  EXPECT_LT(least, 0.35);  // an overlap is aimed at, not guaranteed
  EXPECT_GT(most, 0.6);
}

TEST(RoomPair, SharesWallsButNoFurnitureIfLookalike) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const FurnishedPair pair = furnishedPair(PairKind::kLookalike, ofPair(seed));
    const FurnishedScene &one = pair.scenes[0], &two = pair.scenes[1];
    EXPECT_FALSE(pair.map_from_r2);
    ASSERT_EQ(one.house.walls.size(), two.house.walls.size());
    for (std::size_t k = 0; k < one.house.walls.size(); ++k)
      EXPECT_TRUE(isWallEqual(one.room.solids[k], two.room.solids[k])) << "seed " << seed;
    EXPECT_EQ(one.room.floor, two.room.floor);
    EXPECT_EQ(one.room.floor_albedo, two.room.floor_albedo);
    ASSERT_GE(two.house.furniture.size(), 4U);
    EXPECT_EQ(two.room.solids.size(), two.house.walls.size() + two.house.furniture.size());
    for (const Solid& piece : two.house.furniture) {
      EXPECT_FALSE(std::any_of(one.house.furniture.begin(), one.house.furniture.end(),
                               [&](const Solid& other) { return isAlike(piece, other); }))
          << "seed " << seed;
    }
    for (const FurnishedScene& scene : pair.scenes)  // nobody sees the other one
      EXPECT_EQ(scene.drive.frames.front().poses.size(), 1U);
  }
}

TEST(RoomPair, DiffersInSizeAndFloorIfDisjoint) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const FurnishedPair pair = furnishedPair(PairKind::kDisjoint, ofPair(seed));
    const FurnishedScene &one = pair.scenes[0], &two = pair.scenes[1];
    EXPECT_FALSE(pair.map_from_r2);
    const Eigen::Vector2d change = two.house.rooms.front().size() - one.house.rooms.front().size();
    EXPECT_GT(change.cwiseAbs().maxCoeff(), 0.4) << "seed " << seed;
    EXPECT_NE(one.room.floor_albedo, two.room.floor_albedo);
    EXPECT_EQ(two.drive.frames.front().poses.size(), 1U);
  }
}

/// A recording in a folder that is removed at the end.
class PairRecording {
 public:
  PairRecording(PairKind kind, unsigned seed)
      : folder(fs::path(::testing::TempDir()) / ("omnifleet_pair_" + std::to_string(::getpid()))) {
    fs::remove_all(folder);
    FurnishedOptions options = ofPair(seed);
    options.frames = 5;
    recordPair(folder.string(), kind, options);
  }
  ~PairRecording() { fs::remove_all(folder); }

  std::string text(const std::string& file) const {
    std::ifstream in(folder / file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }

  const fs::path folder;
};

TEST(RoomPair, RecordsSecondRobotWithoutInitialPose) {
  for (const PairKind kind : {PairKind::kSame, PairKind::kLookalike, PairKind::kDisjoint}) {
    const PairRecording recording(kind, 3);
    const dataset::Dataset data = dataset::Dataset::open(recording.folder.string());
    EXPECT_TRUE(data.warnings.empty());
    ASSERT_EQ(data.robots.size(), 2U);
    EXPECT_TRUE(data.robots[0].initial_pose);
    EXPECT_FALSE(data.robots[1].initial_pose);
    for (const dataset::RobotRecording& robot : data.robots) {
      EXPECT_EQ(robot.fisheye->rows.size(), 5U);
      EXPECT_GE(robot.wheels.size(), 8U);
      EXPECT_EQ(robot.fisheye->rows.front().time_ns, kBegin_ns);
    }
  }
}

TEST(RoomPair, RecordsWhatIsRight) {
  const PairRecording same(PairKind::kSame, 4);
  const auto truth = dataset::GroundTruth::load(same.folder.string());
  const Pose2 first = truth.trajectories.at("r2").front().map_from_base;
  double x = 0.0, y = 0.0, theta = 0.0;
  const std::string said = same.text("groundtruth/pair.json");
  EXPECT_NE(said.find("\"kind\": \"same\""), std::string::npos) << said;
  const std::size_t at = said.find("\"map_from_r2\": [");
  ASSERT_NE(at, std::string::npos) << said;
  ASSERT_EQ(std::sscanf(said.c_str() + at, "\"map_from_r2\": [%lf, %lf, %lf]", &x, &y, &theta), 3);
  EXPECT_NEAR(x, first.x_m, 1e-6);  // a TUM file has 6 decimals or more
  EXPECT_NEAR(y, first.y_m, 1e-6);
  EXPECT_NEAR(wrapAngle(theta - first.theta_rad), 0.0, 1e-6);
  EXPECT_FALSE(fs::exists(same.folder / "groundtruth/r2"));
}

TEST(RoomPair, RecordsTruthOfEachRoomIfTheyDiffer) {
  const PairRecording other(PairKind::kDisjoint, 5);
  EXPECT_NE(other.text("groundtruth/pair.json").find("\"map_from_r2\": null"), std::string::npos);
  const FurnishedPair pair = furnishedPair(PairKind::kDisjoint, ofPair(5));
  const auto truth = dataset::GroundTruth::load(other.folder.string());
  EXPECT_EQ(truth.scene.size(), pair.scenes[0].house.furniture.size());
  const auto room = dataset::readObjects((other.folder / "groundtruth/r2/room.geojson").string());
  ASSERT_EQ(room.size(), 1U);
  EXPECT_NEAR((room[0].outline_m[2] - room[0].outline_m[0]).x(),
              pair.scenes[1].house.rooms.front().size().x(), 1e-3);
  const auto scene = dataset::readObjects((other.folder / "groundtruth/r2/scene.geojson").string());
  EXPECT_EQ(scene.size(), pair.scenes[1].house.furniture.size());
}

}  // namespace
}  // namespace omnifleet::raycast
