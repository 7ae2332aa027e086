// The arenas of the experiment and its measure of the reachable floor.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fleet/fleet.h"
#include "tests/experiments/exploration/arena.h"
#include "tests/experiments/exploration/coverage.h"
#include "world/body_gaps.h"

namespace omnifleet::exploration {
namespace {

Polygon rectangle(double left, double low, double right, double high) {
  return {{left, low}, {right, low}, {right, high}, {left, high}};
}

/// A room of 2 × 1 m, divided by a wall with a gap between x = 0.98 and 1.02 m.
TrueRoom roomWithGap(double gap_m) {
  TrueRoom room;
  room.room_m = rectangle(0.0, 0.0, 2.0, 1.0);
  room.solids_m = {rectangle(0.98, 0.0, 1.02, 0.5 - 0.5 * gap_m),
                   rectangle(0.98, 0.5 + 0.5 * gap_m, 1.02, 1.0)};
  room.starts = {{0.4, 0.5, 0.0}};
  return room;
}

/// All cells free but those of one rectangle, which are unknown.
dataset::OccupancyGrid mapWithout(const Polygon& unknown) {
  dataset::OccupancyGrid map;
  map.resolution_m = 0.02;
  map.width = 100;
  map.height = 50;
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x)
      map.cells.push_back(contains(unknown, {0.02 * (x + 0.5), 0.02 * (y + 0.5)}) ? -1 : 0);
  return map;
}

TEST(ReachableFloor, EndsAtGapThatIsNarrowerThanBodyAndMargins) {
  constexpr double kReach_m = 0.1, kMargin_m = 0.05;
  const ReachableFloor narrow = ReachableFloor::of(roomWithGap(0.28), kReach_m, kMargin_m, 3.0);
  const ReachableFloor wide = ReachableFloor::of(roomWithGap(0.34), kReach_m, kMargin_m, 3.0);
  // Without the corners that a circle of 15 cm does not cover: (1 − π/4)·15² cm² each.
  const double corner_m2 = (1.0 - M_PI_4) * 0.15 * 0.15;
  constexpr double kRounded_m2 = 0.02;  // cells of 1 cm along 2 m of arcs
  EXPECT_NEAR(1e-4 * cv::countNonZero(narrow.covered), 0.98 - 4.0 * corner_m2, kRounded_m2);
  EXPECT_NEAR(1e-4 * cv::countNonZero(wide.covered), 2.0 - 0.04 * 0.66 - 8.0 * corner_m2, kRounded_m2);
  EXPECT_GT(cv::countNonZero(narrow.visible), cv::countNonZero(narrow.covered))
      << "floor behind the gap is seen through it";
}

TEST(ReachableFloor, CountsUnknownFloorAndWrongCells) {
  const TrueRoom room = roomWithGap(0.34);
  const ReachableFloor floor = ReachableFloor::of(room, 0.1, 0.05, 3.0);
  const Coverage all = compare(mapWithout({}), floor, room);
  EXPECT_EQ(all.covered_share, 1.0);
  EXPECT_EQ(all.visible_share, 1.0);
  EXPECT_EQ(all.wrong_m2, 0.0) << "free cells at most 2 cm inside of a solid";
  const Coverage part = compare(mapWithout(rectangle(0.4, 0.4, 0.6, 0.6)), floor, room);
  EXPECT_NEAR((1.0 - part.covered_share) * part.covered_m2, 0.04, 1e-6);
  dataset::OccupancyGrid phantom = mapWithout({});
  phantom.cells[25 * 100 + 25] = 100;  // far from all faces
  EXPECT_NEAR(compare(phantom, floor, room).wrong_m2, 0.0004, 1e-9);
}

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(ExplorationArena, DependsOnSeedAloneAndStartsWithoutContact) {
  const std::string arenas = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/arenas";
  const std::string out = testing::TempDir() + "/omnifleet_exploration";
  std::filesystem::remove_all(out);
  std::string before;
  for (std::uint32_t seed = 0; seed < 24; ++seed) {
    const std::string file = writeFleet(seed, arenas, 60.0, out);
    const std::string text = textOf(out + "/arena.yaml");
    EXPECT_NE(text, before) << seed;
    before = text;
    writeFleet(seed, arenas, 60.0, out);
    EXPECT_EQ(textOf(out + "/arena.yaml"), before) << seed;
    const fleet::Fleet fleet = fleet::Fleet::load(file, {}, {});
    EXPECT_EQ(fleet.mappingRobots(), (std::vector<std::string>{"r1", "r2"}));
    const std::vector<synthetic::ArenaRobot>& robots = fleet.arena->robots;
    for (std::size_t i = 0; i < robots.size(); ++i) {
      const Pose2& pose = robots[i].initial_map_from_base;
      for (const synthetic::Solid& solid : fleet.arena->solids)
        EXPECT_GT(world::gapToSolid(robots[i].body, pose, solid, solid.map_from_solid), 0.0) << seed;
      for (std::size_t k = 0; k < i; ++k)
        EXPECT_GT(world::gapToBody(robots[i].body, pose, robots[k].body, robots[k].initial_map_from_base),
                  0.1)
            << seed;
    }
  }
  std::filesystem::remove_all(out);
}

}  // namespace
}  // namespace omnifleet::exploration
