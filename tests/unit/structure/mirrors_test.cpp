// Gaps in walls that can be mirrors, in scenes in closed form: a mirror shows the room once more behind the
// gap.
#include "structure/mirrors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "surface_scene.h"

namespace omnifleet::structure {
namespace {

using Eigen::Vector2d;
using testing::SurfaceScene;

constexpr double kReach_m = 0.3;
constexpr double kThick_m = 0.02, kHalfGap_m = 0.6;
const std::vector<Vector2d> kPath{{-2.0, -0.8}, {-1.3, -0.2}, {-0.5, 0.0}};

/// Two rooms, left and right of a thin wall x = 0 with a gap. The robot is in the left one.
SurfaceScene twoRooms(const std::vector<Polygon>& left, const std::vector<Polygon>& right,
                      double right_depth_m = 2.6) {
  SurfaceScene scene;
  const double wall = 0.5 * kThick_m;
  scene.room = {{-2.6, -1.5},       {-wall, -1.5},         {-wall, -kHalfGap_m}, {wall, -kHalfGap_m},
                {wall, -1.5},       {right_depth_m, -1.5}, {right_depth_m, 1.5}, {wall, 1.5},
                {wall, kHalfGap_m}, {-wall, kHalfGap_m},   {-wall, 1.5},         {-2.6, 1.5}};
  scene.obstacles = left;
  scene.obstacles.insert(scene.obstacles.end(), right.begin(), right.end());
  scene.viewpoints = kPath;
  return scene;
}

const Polygon kBox = testing::rectangle({-1.3, 0.7}, 0.4, 0.3, 0.2),
              kImage = testing::rectangle({1.3, 0.7}, 0.4, 0.3, -0.2);

SurfaceScene mirrorScene() {
  return twoRooms({kBox}, {kImage});
}

int cellsBehind(const SurfaceMap& map, Cell wanted) {
  int count = 0;
  for (std::size_t at = 0; at < map.cells.size(); ++at) {
    const double x = map.origin_m.x() +
                     map.resolution_m * (static_cast<double>(at % static_cast<std::size_t>(map.width)) + 0.5);
    count += x > 0.05 && map.cells[at] == wanted ? 1 : 0;
  }
  return count;
}

TEST(Mirrors, HidesWhatAMirrorShows) {
  for (const double noise_m : {0.0, 0.01}) {
    const SurfaceMap seen = mirrorScene().map(0.05, noise_m);
    ASSERT_GT(cellsBehind(seen, Cell::kFree), 500);
    ASSERT_GT(cellsBehind(seen, Cell::kOccupied), 30);
    SurfaceMap map = seen;
    hideBehindMirrors(map, kPath, kReach_m, {});
    ASSERT_EQ(map.mirrors.size(), 1U);
    EXPECT_NEAR(map.mirrors[0].middle().x(), 0.0, 0.05);
    EXPECT_NEAR(map.mirrors[0].middle().y(), 0.0, 0.05);
    EXPECT_NEAR((map.mirrors[0].to_m - map.mirrors[0].from_m).norm(), 2.0 * kHalfGap_m, 0.1);
    EXPECT_EQ(cellsBehind(map, Cell::kFree), 0);
    EXPECT_EQ(cellsBehind(map, Cell::kOccupied), 0);
    EXPECT_TRUE(map.isMirrored({1.0, 0.0}));
    EXPECT_FALSE(map.isMirrored({-1.0, 0.0}));
    EXPECT_FALSE(map.isMirrored({99.0, 0.0}));
    for (std::size_t at = 0; at < map.cells.size(); ++at)
      EXPECT_TRUE(map.mirrored[at] != 0 || map.cells[at] == seen.cells[at]);
    for (const SurfaceCell& cell : map.surface) EXPECT_LT(cell.mean_m.x(), 0.05);
  }
}

TEST(Mirrors, KeepsTheRoomInWhichARobotWas) {
  SurfaceMap map = mirrorScene().map();
  const std::vector<Cell> before = map.cells;
  std::vector<Vector2d> path = kPath;
  path.emplace_back(1.0, 0.1);
  hideBehindMirrors(map, path, kReach_m, {});
  EXPECT_TRUE(map.mirrors.empty());
  EXPECT_TRUE(map.mirrored.empty());
  EXPECT_EQ(map.cells, before);
}

/// Cells under a robot that never drives are unknown.
TEST(Mirrors, KeepsTheRoomInWhichARobotTurnsInPlace) {
  SurfaceMap map = mirrorScene().map();
  const Vector2d place(1.0, 0.1);
  for (std::size_t at = 0; at < map.cells.size(); ++at) {
    const auto width = static_cast<std::size_t>(map.width);
    const Vector2d cell = map.origin_m + map.resolution_m * Vector2d(at % width + 0.5, at / width + 0.5);
    if ((cell - place).norm() < 0.2) map.cells[at] = Cell::kUnknown;
  }
  SurfaceMap without = map;
  hideBehindMirrors(without, kPath, kReach_m, {});
  ASSERT_EQ(without.mirrors.size(), 1U) << "or the test shows nothing";
  std::vector<Vector2d> path = kPath;
  path.push_back(place);
  hideBehindMirrors(map, path, kReach_m, {});
  EXPECT_TRUE(map.mirrors.empty());
}

/// A robot near a mirror on this side was not behind it.
TEST(Mirrors, HidesWhatAMirrorBesideARobotShows) {
  SurfaceMap map = mirrorScene().map();
  std::vector<Vector2d> path = kPath;
  path.emplace_back(-0.1, 0.0);
  hideBehindMirrors(map, path, kReach_m, {});
  EXPECT_EQ(map.mirrors.size(), 1U);
}

TEST(Mirrors, KeepsARoomThatDiffersFromItsImage) {
  const Polygon image = testing::rectangle({1.3, 0.7}, 0.4, 0.3, -0.2),
                other = testing::rectangle({1.1, -0.4}, 0.8, 0.9);
  struct {
    const char* name;
    SurfaceScene scene;
  } const cases[] = {
      {"less deep", twoRooms({kBox}, {kImage}, 1.9)},
      {"a large obstacle more", twoRooms({kBox}, {kImage, other}, 5.0)},
      {"a large obstacle less", twoRooms({kBox, testing::rectangle({-0.7, 0.1}, 0.5, 0.4)}, {kImage})}};
  for (const auto& [name, scene] : cases) {
    SurfaceMap map = scene.map();
    const std::vector<Cell> before = map.cells;
    hideBehindMirrors(map, kPath, kReach_m, {});
    EXPECT_TRUE(map.mirrors.empty()) << name;
    EXPECT_TRUE(map.cells == before) << name;
  }
}

/// A few cells can contradict by noise: the share decides.
TEST(Mirrors, AllowForAShareOfContradictingCells) {
  const SurfaceScene scene = twoRooms({kBox}, {kImage, testing::rectangle({1.3, -0.6}, 0.12, 0.12)});
  SurfaceMap map = scene.map(), strict = map;
  hideBehindMirrors(map, kPath, kReach_m, {});
  EXPECT_EQ(map.mirrors.size(), 1U);
  MirrorOptions options;
  options.contradicting_share = 0.0;
  hideBehindMirrors(strict, kPath, kReach_m, options);
  EXPECT_TRUE(strict.mirrors.empty());
}

TEST(Mirrors, NeedsAStraightWallOnBothSides) {
  SurfaceMap map = mirrorScene().map();
  // Without the wall above the gap, as far as it was seen.
  for (SurfaceCell& cell : map.surface)
    if (std::abs(cell.mean_m.x()) < 0.05 && cell.mean_m.y() > kHalfGap_m)
      map.cells[static_cast<std::size_t>(cell.x + cell.y * map.width)] = Cell::kUnknown;
  hideBehindMirrors(map, kPath, kReach_m, {});
  EXPECT_TRUE(map.mirrors.empty());
}

TEST(Mirrors, AreNotSearchedIfSwitchedOff) {
  SurfaceMap map = mirrorScene().map();
  MirrorOptions options;
  options.search = false;
  hideBehindMirrors(map, kPath, kReach_m, options);
  EXPECT_TRUE(map.mirrors.empty());
  EXPECT_GT(cellsBehind(map, Cell::kFree), 500);
}

TEST(Mirrors, DoNotDependOnTheOrderOfTheCells) {
  SurfaceMap map = mirrorScene().map(), reversed = map;
  std::reverse(reversed.surface.begin(), reversed.surface.end());
  hideBehindMirrors(map, kPath, kReach_m, {});
  hideBehindMirrors(reversed, {kPath.rbegin(), kPath.rend()}, kReach_m, {});
  EXPECT_EQ(map.cells, reversed.cells);
  ASSERT_EQ(map.mirrors.size(), reversed.mirrors.size());
  EXPECT_EQ(map.mirrors[0].from_m, reversed.mirrors[0].from_m);
}

TEST(Mirrors, IgnoreAnEmptyMap) {
  SurfaceMap map;
  hideBehindMirrors(map, kPath, kReach_m, {});
  EXPECT_TRUE(map.mirrors.empty());
}

}  // namespace
}  // namespace omnifleet::structure
