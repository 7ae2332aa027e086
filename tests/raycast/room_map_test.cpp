// Maps of furnished rooms with what deceives cameras: a mirror, and persons who walk around.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "fleet_in_process/in_process.h"
#include "geometry/polygon.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

constexpr std::int8_t kFree = 0, kOccupied = 100;

struct MappedRoom {
  FurnishedScene scene;
  dataset::OccupancyGrid grid;
  std::string objects;  ///< text of objects.geojson
};

/// Records a room, maps it, and reads the map. The frame of the map is that of the truth.
MappedRoom mapRoom(const FurnishedOptions& options) {
  const fs::path folder =
      fs::path(::testing::TempDir()) / ("omnifleet_room_map_" + std::to_string(::getpid()));
  recordFurnished((folder / "recording").string(), options);
  services::InProcessRun run;
  run.dataset = (folder / "recording").string();
  run.out = (folder / "out").string();
  run.log_level = "off";
  services::runInProcess(run);
  Random random(options.seed * 7919U + 17U);  // as recordFurnished()
  MappedRoom mapped{furnishedScene(options, random), dataset::readMapServer(run.out + "/map.yaml"), ""};
  std::ifstream objects(run.out + "/objects.geojson");
  mapped.objects.assign(std::istreambuf_iterator<char>(objects), {});
  fs::remove_all(folder);
  return mapped;
}

FurnishedOptions smallRoom(unsigned seed) {
  FurnishedOptions options;
  options.seed = seed;
  options.frames = 50;
  options.width_px = 480;
  options.height_px = 360;
  return options;
}

/// Middles of the cells of one class, m.
std::vector<Eigen::Vector2d> cellsOf(const dataset::OccupancyGrid& grid, std::int8_t value) {
  std::vector<Eigen::Vector2d> cells;
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x)
      if (grid.cells[static_cast<std::size_t>(x + y * grid.width)] == value)
        cells.emplace_back(grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5));
  return cells;
}

double nearestSolid(const House& house, const Eigen::Vector2d& at) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto* list : {&house.walls, &house.furniture})
    for (const Solid& solid : *list) least = std::min(least, distanceTo(solid, at));
  return least;
}

TEST(RoomMap, LeavesWhatAMirrorShowsUnknown) {
  FurnishedOptions options = smallRoom(5000);
  options.mirror = true;
  const MappedRoom mapped = mapRoom(options);
  const double wall_m = mapped.scene.house.rooms.front().low.x();
  int free = 0, free_behind = 0;
  for (const Eigen::Vector2d& cell : cellsOf(mapped.grid, kFree)) {
    ++free;
    free_behind += cell.x() < wall_m - 0.05 && std::abs(cell.y()) < 1.5 ? 1 : 0;
  }
  EXPECT_GT(free, 3000);
  EXPECT_LT(free_behind, 20);
  EXPECT_NE(mapped.objects.find("possible_mirror"), std::string::npos);
}

/// The last second is left out: persons who stand there now may be in the map.
TEST(RoomMap, ForgetsPersonsWhoWalkedAway) {
  FurnishedOptions options = smallRoom(5003);
  options.occluded_share = 0.15;
  const MappedRoom mapped = mapRoom(options);
  const auto& persons = mapped.scene.persons;
  const auto is_at = [&](const Eigen::Vector2d& cell, std::size_t first, std::size_t last) {
    for (std::size_t k = first; k < last; ++k)
      for (const Solid& person : persons[k])
        if (distanceTo(person, cell) < 0.05) return true;
    return false;
  };
  int now = 0, gone = 0, elsewhere = 0;
  for (const Eigen::Vector2d& cell : cellsOf(mapped.grid, kOccupied)) {
    if (nearestSolid(mapped.scene.house, cell) < 0.1) continue;
    if (is_at(cell, persons.size() - 6, persons.size()))
      ++now;
    else
      ++(is_at(cell, 0, persons.size() - 6) ? gone : elsewhere);
  }
  int free = 0;
  for (const Eigen::Vector2d& cell : cellsOf(mapped.grid, kFree))
    free += is_at(cell, 0, persons.size() - 6) ? 1 : 0;
  std::printf("occupied cells: %d of the last second, %d of persons before, %d elsewhere; %d free\n", now,
              gone, elsewhere, free);
  EXPECT_GT(free, 300) << "cells that persons walked over";
  EXPECT_LT(gone, 0.01 * free) << "of the cells that persons walked over";
}

}  // namespace
}  // namespace omnifleet::raycast
