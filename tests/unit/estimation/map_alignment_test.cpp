// Alignment of the map of a robot without initial pose with the map of the other robots.
#include "estimation/map_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

using scan::testing::Scene;

constexpr double kRoomSigma = 0.003;  // 1/m

Polygon rectangle(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

/// Keyframes with exact relations along a path in a room; the frame is that of the first one, or map.
class Explored {
 public:
  Explored(Scene scene, std::uint32_t seed, std::uint32_t robot)
      : scene_(std::move(scene)), random_(seed), robot_(robot) {}

  void drive(const Pose2& room_from_base, const Pose2& frame_from_room) {
    scan::LineScan scan;
    KeyframeMap::Source source;
    source.camera = robot_;
    source.seen = scene_.scan(room_from_base, kRoomSigma, random_);
    source.usable.assign(source.seen.inverse_m.size(), true);
    scan.fit(source.seen);
    KeyframeMap::Held held;
    const double m = map.size() == 0 ? 0.001 : 0.003;
    held.covariance = Eigen::Vector3d(m * m, m * m, m * m).asDiagonal();
    const Pose2 pose = frame_from_room * room_from_base;
    if (map.size() > 0) {
      held.previous = static_cast<KeyframeMap::Id>(map.size() - 1);
      held.previous_from_this = map.pose(*held.previous).inverse() * pose;
    }
    source.rich = false;  // no camera to calibrate
    map.add(pose, std::move(source), scan, held, {});
  }

  const KeyframeOptions options;
  const scan::MatchOptions match;
  KeyframeMap map = KeyframeMap(options, match);

 private:
  Scene scene_;
  std::mt19937 random_;
  std::uint32_t robot_;
};

const Pose2 kOwnFromRoom{1.3, -2.1, 1.1};

/// A circuit of the room. @param from, to share of it
std::vector<Pose2> circuit(double from, double to, int count) {
  std::vector<Pose2> poses;
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * M_PI * (from + (to - from) * k / (count - 1));
    poses.push_back({1.5 * std::cos(angle), 0.75 * std::sin(angle), wrapAngle(angle + 0.5 * M_PI)});
  }
  return poses;
}

MapAlignment::Result align(const Scene& common, const Scene& own, double own_share = 0.7) {
  Explored others(common, 1, 0), robot(own, 2, 1);
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) others.drive(pose, {});
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (const Pose2& pose : circuit(0.4, 0.4 + own_share, 10)) {
    robot.drive(pose, kOwnFromRoom);
    result = alignment.update(others.map, robot.map);
  }
  return result;
}

Scene lookAlike() {
  Scene room = scan::testing::furnishedRoom();
  room.outlines.resize(1);
  room.outlines.push_back(rectangle(-2.5, -2.0, -1.2, -1.4));
  room.outlines.push_back(rectangle(1.3, 1.3, 2.5, 2.0));
  room.outlines.push_back(rectangle(-0.2, -0.1, 0.3, 0.2));
  return room;
}

TEST(MapAlignment, MatchesTwoMapsOfOneRoom) {
  const Scene room = scan::testing::furnishedRoom();
  const MapAlignment::Result result = align(room, room);
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  const Pose2 off = result.map_from_own * kOwnFromRoom;  // map is the room's frame
  EXPECT_LT(off.translation().norm(), 0.01);
  EXPECT_LT(std::abs(off.theta_rad), 0.005);
  EXPECT_GT(result.score, 0.95);
}

TEST(MapAlignment, RejectsEqualWallsWithOtherFurniture) {
  const MapAlignment::Result result = align(scan::testing::furnishedRoom(), lookAlike());
  EXPECT_NE(result.status, AlignmentStatus::kMatched) << result.reason;
}

TEST(MapAlignment, StaysUndecidedInASymmetricRoom) {
  const Scene bare{{rectangle(-2.5, -2.0, 2.5, 2.0)}};
  const MapAlignment::Result result = align(bare, bare);
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
  EXPECT_NE(result.reason.find("another relation"), std::string::npos) << result.reason;
}

TEST(MapAlignment, DoesNotMatchRoomsOfOtherSize) {
  Scene other{
      {rectangle(-2.2, -1.6, 2.2, 1.6), rectangle(-2.2, 1.0, -1.5, 1.6), rectangle(0.2, 0.9, 0.6, 1.2)}};
  const MapAlignment::Result result = align(scan::testing::furnishedRoom(), other);
  EXPECT_NE(result.status, AlignmentStatus::kMatched) << result.reason;
}

TEST(MapAlignment, StaysUndecidedInACorridor) {
  const Scene corridor = scan::testing::corridor();
  Explored others(corridor, 1, 0), robot(corridor, 2, 1);
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (int k = 0; k < 12; ++k) others.drive({0.3 * k, 0.1, 0.0}, {});
  for (int k = 0; k < 12; ++k) {
    robot.drive({0.3 * k + 1.0, -0.1, 0.0}, kOwnFromRoom);
    result = alignment.update(others.map, robot.map);
  }
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
}

TEST(MapAlignment, UsesASuggestedRelation) {
  const Scene room = scan::testing::furnishedRoom();
  Explored others(room, 1, 0), robot(room, 2, 1);
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) others.drive(pose, {});
  for (const Pose2& pose : circuit(0.4, 1.1, 10)) robot.drive(pose, kOwnFromRoom);
  MapAlignmentOptions options;
  options.search.min_score = 1.0;  // no match without the suggestion
  MapAlignment alignment(options);
  EXPECT_NE(alignment.update(others.map, robot.map).status, AlignmentStatus::kMatched);
  alignment.suggest(kOwnFromRoom.inverse() * Pose2{0.1, 0.0, 0.05});
  EXPECT_EQ(alignment.update(others.map, robot.map).status, AlignmentStatus::kMatched);
}

TEST(KeyframeMapAppend, RelatesBothMapsByScanMatches) {
  const Scene room = scan::testing::furnishedRoom();
  Explored others(room, 1, 0), robot(room, 2, 1);
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) others.drive(pose, {});
  const std::vector<Pose2> path = circuit(0.4, 1.1, 10);
  for (const Pose2& pose : path) robot.drive(pose, kOwnFromRoom);
  const Eigen::Matrix3d rough = Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal();
  const Pose2 off{0.03, -0.02, 0.01};  // the relation is found to a few centimetres
  const auto first = others.map.append(robot.map, kOwnFromRoom.inverse() * off, rough);
  ASSERT_EQ(others.map.size(), 26u);
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Pose2 error = path[k].inverse() * others.map.pose(first + static_cast<KeyframeMap::Id>(k));
    EXPECT_LT(error.translation().norm(), 0.006) << k;  // scans of 1 cm at 2 m, several of them
    EXPECT_LT(std::abs(error.theta_rad), 0.004) << k;
  }
  // The robot's keyframes now have known relations to those of the others.
  EXPECT_FALSE(others.map.references(0, 0.0, {path.back()}).empty());
}

}  // namespace
}  // namespace omnifleet::estimation
