// Alignment of the map of a robot without initial pose with the map of the other robots.
#include "estimation/map_alignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "tests/unit/appearance/textured_room.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

using scan::testing::Scene;

constexpr double kRoomSigma = 0.003;  // 1/m

Polygon rectangle(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

/// What robots see on the walls; the images of the robot are turned against its scans.
struct Wallpaper {
  unsigned texture = 5;
  double turned_rad = 0.0;
};

/// Keyframes with exact relations along a path in a room; the frame is that of the first one, or map.
class Explored {
 public:
  Explored(Scene scene, std::uint32_t seed, std::uint32_t robot)
      : scene_(std::move(scene)), random_(seed), robot_(robot) {}

  /// @param other outline of another robot at this time
  void drive(const Pose2& room_from_base, const Pose2& frame_from_room, const Polygon& other = {}) {
    Scene scene = scene_;
    if (!other.empty()) scene.outlines.push_back(other);
    scan::LineScan scan;
    KeyframeMap::Source source;
    source.camera = robot_;
    source.seen = scene.scan(room_from_base, kRoomSigma, random_);
    const std::size_t beams = source.seen.inverse_m.size(),
                      half = static_cast<std::size_t>(forward * 0.5 * beams);
    for (std::size_t i = half; i < beams - half; ++i) source.seen.inverse_m[i] = source.seen.sigma[i] = 0.0f;
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
    const KeyframeMap::Id keyframe = map.add(pose, std::move(source), scan, held, {});
    if (wallpaper) addPlace(room_from_base, pose, keyframe);
  }

  void addPlace(const Pose2& room_from_base, const Pose2& pose, KeyframeMap::Id keyframe) {
    const appearance::PanoramaOptions size;
    appearance::SignatureMaker maker(test::roomUnwrapper(size), {});
    const Pose2 seen_from = room_from_base * Pose2{0.0, 0.0, wallpaper->turned_rad};
    Place place;
    place.robot = robot_ == 0 ? "r1" : "r2";
    place.frame_from_base = pose;
    place.format = maker.format();
    place.signature =
        appearance::store(maker.compute(test::TexturedRoom(wallpaper->texture).panorama(seen_from, size)));
    places.add(std::move(place), keyframe, map, Eigen::Matrix3d::Identity());
  }
  MapToAlign all() const { return {map, {&places}}; }

  const KeyframeOptions options;
  const scan::MatchOptions match;
  KeyframeMap map = KeyframeMap(options, match);
  PlaceMemory places;
  std::optional<Wallpaper> wallpaper;
  double forward = 1.0;  ///< share of the circle that a scan shows

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

MapAlignment::Result align(const Scene& common, const Scene& own, double own_share = 0.7,
                           const std::optional<Wallpaper>& wallpaper = std::nullopt) {
  Explored others(common, 1, 0), robot(own, 2, 1);
  if (wallpaper) {
    others.wallpaper = Wallpaper{wallpaper->texture, 0.0};
    robot.wallpaper = wallpaper;
  }
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) others.drive(pose, {});
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (const Pose2& pose : circuit(0.4, 0.4 + own_share, 10)) {
    robot.drive(pose, kOwnFromRoom);
    result = alignment.update(others.all(), robot.all());
  }
  return result;
}

/// The same while each robot drives past the other one, which its scans show as a box.
MapAlignment::Result alignAmongRobots(const Scene& room) {
  Explored others(room, 1, 0), robot(room, 2, 1);
  const auto body = [](const Pose2& at) {
    return rectangle(at.x_m - 0.2, at.y_m - 0.2, at.x_m + 0.2, at.y_m + 0.2);
  };
  const std::vector<Pose2> theirs = circuit(0.0, 1.0, 16), mine = circuit(0.5, 1.3, 13);
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (std::size_t k = 0; k < theirs.size(); ++k) {
    others.drive(theirs[k], {}, body(mine[std::min(k, mine.size() - 1)]));
    if (k < mine.size()) robot.drive(mine[k], kOwnFromRoom, body(theirs[k]));
    result = alignment.update(others.all(), robot.all());
    if (result.status == AlignmentStatus::kMatched) break;
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

/// The same after half a turn.
Scene symmetricRoom() {
  return {{rectangle(-2.5, -2.0, 2.5, 2.0), rectangle(1.7, 1.2, 2.4, 1.9), rectangle(-2.4, -1.9, -1.7, -1.2),
           rectangle(-0.4, 1.3, 0.1, 2.0), rectangle(-0.1, -2.0, 0.4, -1.3)}};
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

// Each robot sees the other one as furniture that moves: surfaces of its map that the other map denies.
TEST(MapAlignment, MatchesTwoMapsWhoseRobotsSeeEachOther) {
  const MapAlignment::Result result = alignAmongRobots(scan::testing::furnishedRoom());
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  const Pose2 off = result.map_from_own * kOwnFromRoom;
  EXPECT_LT(off.translation().norm(), 0.02);
  EXPECT_LT(std::abs(off.theta_rad), 0.01);
  EXPECT_GT(result.score, 0.95) << result.reason;
}

// The others come to the robot's room when it stands still. They see half of the circle, which is too little
// to be searched in the robot's map. So only its older scans find the relation.
TEST(MapAlignment, SearchesOlderScansAgainWhereTheOtherMapHasGrown) {
  Scene rooms = scan::testing::furnishedRoom();
  rooms.outlines.push_back(rectangle(8.0, -0.7, 9.2, 0.7));  // where the others start
  Explored others(rooms, 1, 0), robot(rooms, 2, 1);
  others.forward = 0.5;
  MapAlignmentOptions options;
  options.search.min_beams = 500;  // of 720
  MapAlignment alignment(options);
  others.drive({8.6, 0.0, 0.0}, {});
  MapAlignment::Result result;
  for (const Pose2& pose : circuit(0.5, 0.8, 5)) {
    robot.drive(pose, kOwnFromRoom);
    result = alignment.update(others.all(), robot.all());
  }
  ASSERT_NE(result.status, AlignmentStatus::kMatched) << result.reason;
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) {
    others.drive(pose, {});
    result = alignment.update(others.all(), robot.all());
  }
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  EXPECT_LT((result.map_from_own * kOwnFromRoom).translation().norm(), 0.02);
}

TEST(MapAlignment, RejectsEqualWallsWithOtherFurniture) {
  const MapAlignment::Result result = align(scan::testing::furnishedRoom(), lookAlike());
  EXPECT_NE(result.status, AlignmentStatus::kMatched) << result.reason;
}

TEST(MapAlignment, StaysUndecidedInASymmetricRoom) {
  const MapAlignment::Result result = align(symmetricRoom(), symmetricRoom());
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
  EXPECT_NE(result.reason.find("another relation"), std::string::npos) << result.reason;
}

// The scans of the robot fit best where the others have been, turned by π: it sees its corner as they saw the
// opposite one. Its own map shows that the room is symmetric.
TEST(MapAlignment, StaysUndecidedInASymmetricRoomSeenFromOppositeCorners) {
  const Scene room = symmetricRoom();
  Explored others(room, 1, 0), robot(room, 2, 1);
  for (const Pose2& pose : circuit(0.0, 0.25, 6)) others.drive(pose, {});
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (const Pose2& pose : circuit(0.5, 0.75, 6)) {
    robot.drive(pose, kOwnFromRoom);
    result = alignment.update(others.all(), robot.all());
    EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
  }
  EXPECT_NE(result.reason.find("another relation"), std::string::npos) << result.reason;
}

/// Three rooms in a row, joined by gaps, equal to themselves after half a turn. From the end rooms a narrow
/// part of the middle one is visible, and from there a narrow part of the end rooms. Two boxes in the middle
/// room break the symmetry.
Scene threeRooms(bool boxes) {
  Scene scene{
      {rectangle(-6.0, -2.0, 6.0, 2.0), rectangle(-2.1, -2.0, -2.0, 1.2), rectangle(2.0, -1.2, 2.1, 2.0),
       rectangle(-5.2, 1.4, -4.2, 2.0), rectangle(4.2, -2.0, 5.2, -1.4), rectangle(-6.0, -1.2, -5.5, -0.4),
       rectangle(5.5, 0.4, 6.0, 1.2), rectangle(-3.4, -2.0, -2.9, -1.6), rectangle(2.9, 1.6, 3.4, 2.0),
       rectangle(-1.2, -2.0, -0.7, -1.6), rectangle(0.7, 1.6, 1.2, 2.0)}};
  if (!boxes) return scene;
  scene.outlines.push_back(rectangle(0.5, -0.9, 0.8, -0.6));
  scene.outlines.push_back(rectangle(-0.4, 0.9, 0.3, 1.3));
  return scene;
}

std::vector<Pose2> aroundPlace(const Eigen::Vector2d& place, int count) {
  std::vector<Pose2> poses;
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * M_PI * k / count;
    poses.push_back({place.x() + 0.9 * std::cos(angle), place.y() + 0.65 * std::sin(angle),
                     wrapAngle(angle + 0.5 * M_PI)});
  }
  return poses;
}

/// The others have seen the left room alone. The robot drives in the middle room, then to an end room: side
/// −1 the left one, 1 the right one.
MapAlignment::Result alignFromMiddleRoom(const Scene& scene, double side) {
  Explored others(scene, 1, 0), robot(scene, 2, 1);
  for (const Pose2& pose : aroundPlace({-4.2, 0.0}, 6)) others.drive(pose, {});
  std::vector<Pose2> path = aroundPlace({0.0, 0.0}, 4);
  path.push_back({side * 1.6, side * -1.6, 0.0});
  path.push_back({side * 2.5, side * -1.6, 0.0});
  for (const Pose2& pose : aroundPlace({side * 4.2, 0.0}, 3)) path.push_back(pose);
  const MapAlignmentOptions defaults;
  MapAlignment alignment(defaults);
  MapAlignment::Result result;
  for (const Pose2& pose : path) {
    robot.drive(pose, kOwnFromRoom);
    result = alignment.update(others.all(), robot.all());
    if (result.status == AlignmentStatus::kMatched) break;  // the maps are merged from here on
  }
  return result;
}

// In the right room the scans of the robot agree with those of the others in the left one, turned by π. At
// the right relation both maps have hardly a surface in common, so no search of a scan finds it. Only the
// symmetry of the robot's own map shows that this relation is possible, too.
TEST(MapAlignment, StaysUndecidedWhereOnlyTheOwnMapShowsTheSymmetry) {
  const MapAlignment::Result result = alignFromMiddleRoom(threeRooms(false), 1.0);
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
  EXPECT_NE(result.reason.find("another relation"), std::string::npos) << result.reason;
}

// The same paths and surfaces in common, but the own map is not symmetric.
TEST(MapAlignment, MatchesAnEndRoomWhereTheOwnMapShowsNoSymmetry) {
  const MapAlignment::Result result = alignFromMiddleRoom(threeRooms(true), -1.0);
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  const Pose2 off = result.map_from_own * kOwnFromRoom;
  EXPECT_LT(off.translation().norm(), 0.02);  // scans of 1 cm at 2 m
  EXPECT_LT(std::abs(off.theta_rad), 0.01);
}

// Laid against the outside of the long wall, the robot's map contradicts nothing. That is no symmetry: none
// of its scans matches there.
TEST(MapAlignment, TakesNoMapForSymmetricThatCanBeLaidBesideItself) {
  Scene room{{rectangle(-4.0, -0.1, 4.0, 0.0)}};
  for (const Polygon& furniture :
       {rectangle(-3.6, 1.2, -2.6, 1.9), rectangle(-1.9, 2.6, -0.9, 3.1), rectangle(-0.7, 0.9, 0.1, 1.3),
        rectangle(0.9, 2.3, 1.5, 3.2), rectangle(1.9, 0.9, 2.9, 1.4), rectangle(3.2, 2.0, 3.9, 2.9)})
    room.outlines.push_back(furniture);
  Explored others(room, 1, 0), robot(room, 2, 1);
  const auto along = [](double x_m, double turn_rad) { return Pose2{x_m, 1.75, turn_rad}; };
  for (int k = 0; k < 12; ++k) others.drive(along(-2.2 + 0.35 * k, 0.0), {});
  MapAlignmentOptions options;
  options.search.min_score = 0.25;
  MapAlignment alignment(options);
  MapAlignment::Result result;
  for (int k = 0; k < 10; ++k) {
    robot.drive(along(2.0 - 0.35 * k, 2.5), kOwnFromRoom);
    result = alignment.update(others.all(), robot.all());
  }
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  EXPECT_LT((result.map_from_own * kOwnFromRoom).translation().norm(), 0.02);
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
    result = alignment.update(others.all(), robot.all());
  }
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided) << result.reason;
}

// The wallpaper differs from side to side, so the visual compass decides between both relations.
TEST(MapAlignment, MatchesASymmetricRoomWhereTheImagesDistinguishItsSides) {
  const MapAlignment::Result result = align(symmetricRoom(), symmetricRoom(), 0.7, Wallpaper{});
  ASSERT_EQ(result.status, AlignmentStatus::kMatched) << result.reason;
  const Pose2 off = result.map_from_own * kOwnFromRoom;
  EXPECT_LT(off.translation().norm(), 0.02);
  EXPECT_LT(std::abs(off.theta_rad), 0.01);  // not π
}

// Same surfaces, but the images say another heading.
TEST(MapAlignment, ImagesThatContradictTheHeadingKeepMapsApart) {
  const Scene room = scan::testing::furnishedRoom();
  const MapAlignment::Result result = align(room, room, 0.7, Wallpaper{5, 0.5 * M_PI});
  EXPECT_NE(result.status, AlignmentStatus::kMatched) << result.reason;
  EXPECT_NE(result.reason.find("images contradict"), std::string::npos) << result.reason;
}

// Evidence grows with the surfaces that both maps show: few of them do not join two maps.
TEST(MapAlignment, StaysUndecidedOnLittleEvidence) {
  const Scene room = scan::testing::furnishedRoom();
  Explored others(room, 1, 0), robot(room, 2, 1);
  for (const Pose2& pose : circuit(0.0, 1.0, 16)) others.drive(pose, {});
  for (const Pose2& pose : circuit(0.4, 1.1, 10)) robot.drive(pose, kOwnFromRoom);
  MapAlignmentOptions options;
  EXPECT_EQ(MapAlignment(options).update(others.all(), robot.all()).status, AlignmentStatus::kMatched);
  options.least_evidence = 100.0;  // nats; these rooms have no such evidence
  const MapAlignment::Result result = MapAlignment(options).update(others.all(), robot.all());
  EXPECT_EQ(result.status, AlignmentStatus::kUndecided);
  EXPECT_NE(result.reason.find("more must agree"), std::string::npos) << result.reason;
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
