// The cells that do not contradict each other: a wall with floor behind it that some rays seem to show.

#include "occupancy/visible_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {
namespace {

using structure::Cell;
using structure::SurfaceMap;

/// A wall along x from −1.5 to 1.5 m and another one behind it. Robots stand before it at y = 0.
struct TwoWalls {
  double front_m = 1.02, back_m = 1.82;
  double hole_from_m = 0.0, hole_to_m = 0.0;  ///< x of an opening in the front wall
  double noise_m = 0.0;                       ///< of the ranges
  /// Rays that miss the front wall.
  std::function<bool(int keyframe, int ray)> passes = [](int, int) { return false; };
};

struct Observed {
  std::vector<Contribution> contributions;
  std::vector<KeyframePose> poses;
};

/// Range along a ray to the wall y = `wall_m`; 0 if it is not met.
double rangeTo(double wall_m, const Eigen::Vector2d& from, const Eigen::Vector2d& along) {
  if (along.y() < 0.05) return 0.0;
  const double range_m = (wall_m - from.y()) / along.y();
  return std::abs(from.x() + range_m * along.x()) <= 1.5 ? range_m : 0.0;
}

constexpr int kRaysPerScan = 720;

Contribution observe(const TwoWalls& walls, const Pose2& from, int keyframe, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Contribution seen;
  seen.robot = "r1";
  seen.acquired_ns = keyframe * TimeNs{500000000};
  for (int i = 0; i < kRaysPerScan; ++i) {
    const double bearing = from.theta_rad + 2.0 * M_PI * i / kRaysPerScan;
    const Eigen::Vector2d along(std::cos(bearing), std::sin(bearing));
    double range_m = rangeTo(walls.front_m, from.translation(), along);
    const double at_m = from.x_m + range_m * along.x();
    const bool in_hole = at_m > walls.hole_from_m && at_m < walls.hole_to_m;
    if (range_m > 0.0 && (in_hole || walls.passes(keyframe, i)))
      range_m = rangeTo(walls.back_m, from.translation(), along);
    const bool is_hit = range_m > 0.0;
    if (is_hit) range_m += walls.noise_m * normal(random);
    seen.range_dmm.push_back(static_cast<std::int32_t>(std::lround(1e4 * (is_hit ? range_m : 0.8))));
    seen.sigma_dmm.push_back(static_cast<std::uint16_t>(std::lround(1e4 * walls.noise_m)));
    seen.label.push_back(is_hit ? RayLabel::kObstacle : RayLabel::kFloorEnd);
    seen.object.push_back(0);
  }
  return seen;
}

KeyframePose standAt(const Contribution& seen, const Pose2& at) {
  PoseEstimate pose;
  pose.robot = seen.robot;
  pose.acquired_ns = seen.acquired_ns;
  pose.valid = true;
  pose.map_from_base = at;
  return makeKeyframePose(pose);
}

/// Twelve keyframes along the wall.
Observed driveAlong(const TwoWalls& walls, unsigned seed = 1) {
  std::mt19937 random(seed);
  Observed all;
  for (int k = 0; k < 12; ++k) {
    const Pose2 at{-0.55 + 0.1 * k, 0.0, 0.3 * k};
    all.contributions.push_back(observe(walls, at, k, random));
    all.poses.push_back(standAt(all.contributions.back(), at));
  }
  return all;
}

OccupancyMap mapFrom(const Observed& all, const OccupancyOptions& options = {}) {
  OccupancyMap map(options, {});
  for (const Contribution& seen : all.contributions) map.add(seen);
  for (const KeyframePose& pose : all.poses) map.add(pose);
  return map;
}

Cell visibleAt(const SurfaceMap& map, const Eigen::Vector2d& at_m) {
  const Eigen::Vector2d cell = (at_m - map.origin_m) / map.resolution_m;
  const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return Cell::kUnknown;
  return map.cells[static_cast<std::size_t>(x + y * map.width)];
}

struct Numbers {
  int counted_free = 0, counted_occupied = 0, visible_free = 0, visible_occupied = 0;
};

/// Cells within 0.5 m of x = 0 and between two y.
Numbers cellsBetween(const OccupancyMap& map, double from_m, double to_m) {
  Numbers n;
  const SurfaceMap& visible = map.visible();
  for (double y = from_m + 0.025; y < to_m; y += 0.05) {
    for (double x = -0.475; x < 0.5; x += 0.05) {
      const CellClass counted = map.at({x, y});
      n.counted_free += counted == CellClass::kFree ? 1 : 0;
      n.counted_occupied += counted == CellClass::kOccupied ? 1 : 0;
      n.visible_free += visibleAt(visible, {x, y}) == Cell::kFree ? 1 : 0;
      n.visible_occupied += visibleAt(visible, {x, y}) == Cell::kOccupied ? 1 : 0;
    }
  }
  return n;
}

void expectSameMap(const SurfaceMap& a, const SurfaceMap& b) {
  EXPECT_EQ(a.origin_m, b.origin_m);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.cells, b.cells);
  ASSERT_EQ(a.surface.size(), b.surface.size());
  for (std::size_t i = 0; i < a.surface.size(); ++i) {
    EXPECT_EQ(a.surface[i].x, b.surface[i].x);
    EXPECT_EQ(a.surface[i].y, b.surface[i].y);
    EXPECT_EQ(a.surface[i].mean_m, b.surface[i].mean_m);
    EXPECT_EQ(a.surface[i].sigma_m, b.surface[i].sigma_m);
    EXPECT_EQ(a.surface[i].observations, b.surface[i].observations);
    EXPECT_EQ(a.surface[i].observers, b.surface[i].observers);
  }
}

TEST(VisibleMap, HidesFloorAndEdgesBehindAWallThatMostRaysHit) {
  TwoWalls by_ray, by_keyframe;
  by_ray.passes = [](int, int ray) { return ray % 4 == 0; };
  by_keyframe.passes = [](int keyframe, int) { return keyframe % 4 == 3; };
  for (const TwoWalls& walls : {by_ray, by_keyframe}) {
    const OccupancyMap map = mapFrom(driveAlong(walls));
    const Numbers before = cellsBetween(map, 0.6, 1.0), wall = cellsBetween(map, 1.0, 1.05);
    EXPECT_EQ(before.visible_free, before.counted_free);
    EXPECT_EQ(before.visible_free, 20 * 8);
    EXPECT_EQ(wall.visible_occupied, 20);
    const Numbers between = cellsBetween(map, 1.05, 1.8), back = cellsBetween(map, 1.8, 1.85);
    EXPECT_GT(between.counted_free, 200) << "of 300, or the test shows nothing";
    EXPECT_EQ(between.visible_free, 0);
    EXPECT_GT(back.counted_occupied, 15);
    EXPECT_EQ(back.visible_occupied, 0);
  }
}

TEST(VisibleMap, ShowsSurfacesButNoFloorThroughANarrowHole) {
  TwoWalls walls;
  walls.hole_to_m = 0.1;
  const OccupancyMap map = mapFrom(driveAlong(walls));
  const Numbers between = cellsBetween(map, 1.05, 1.8), back = cellsBetween(map, 1.8, 1.85);
  EXPECT_EQ(map.at({0.05, 1.03}), CellClass::kFree) << "the hole";
  EXPECT_GT(between.counted_free, 60);
  EXPECT_EQ(between.visible_free, 0);
  EXPECT_GE(back.counted_occupied, 8);
  // Slanted rays to the last cell of each side end first in its neighbour.
  EXPECT_GE(back.visible_occupied, back.counted_occupied - 2);
}

TEST(VisibleMap, ShowsFloorThroughADoor) {
  TwoWalls walls;
  walls.hole_to_m = 0.3;
  const OccupancyMap map = mapFrom(driveAlong(walls));
  const Numbers between = cellsBetween(map, 1.05, 1.8), back = cellsBetween(map, 1.8, 1.85);
  EXPECT_GT(between.counted_free, 100);
  // Slanted rays beside the frame of the door pass through its occupied cells.
  EXPECT_GT(between.visible_free, 0.95 * between.counted_free);
  EXPECT_GE(back.visible_occupied, back.counted_occupied - 2);
  EXPECT_EQ(visibleAt(map.visible(), {0.15, 1.4}), Cell::kFree);
}

TEST(VisibleMap, ShowsFloorThroughAHoleWiderThanTheLeastGap) {
  TwoWalls walls;
  walls.hole_to_m = 0.1;
  OccupancyOptions options;
  options.least_gap_m = 0.05;
  EXPECT_GT(cellsBetween(mapFrom(driveAlong(walls), options), 1.05, 1.8).visible_free, 60);
  walls.hole_to_m = 0.3;
  options.least_gap_m = 0.35;
  EXPECT_EQ(cellsBetween(mapFrom(driveAlong(walls), options), 1.05, 1.8).visible_free, 0);
}

/// The part of the wall within 0.3 m of x = 0 is seen with another label than the rest.
Observed seeMiddleAs(RayLabel label) {
  Observed all = driveAlong({});
  for (std::size_t k = 0; k < all.contributions.size(); ++k) {
    Contribution& seen = all.contributions[k];
    const Pose2 at{-0.55 + 0.1 * static_cast<double>(k), 0.0, 0.3 * static_cast<double>(k)};
    for (std::size_t i = 0; i < seen.label.size(); ++i) {
      const double bearing = at.theta_rad + 2.0 * M_PI * static_cast<double>(i) / kRaysPerScan;
      const double x = at.x_m + 1e-4 * seen.range_dmm[i] * std::cos(bearing);
      if (seen.label[i] == RayLabel::kObstacle && std::abs(x) < 0.3) seen.label[i] = label;
    }
  }
  return all;
}

// A card lies before the wall: floor was seen between both, but a low object may stand where the card is.
TEST(VisibleMap, ShowsAWallBehindSomethingLowWithoutFloorBeforeIt) {
  const OccupancyMap map = mapFrom(seeMiddleAs(RayLabel::kBeyond));
  EXPECT_EQ(cellsBetween(map, 1.0, 1.05).visible_occupied, 20);
  EXPECT_EQ(visibleAt(map.visible(), {0.025, 0.925}), Cell::kUnknown);
}

// Where the floor ends is not known: the object may begin nearer.
TEST(VisibleMap, HidesAnObstacleBeforeWhichNoFloorWasSeen) {
  const OccupancyMap map = mapFrom(seeMiddleAs(RayLabel::kUnknown));
  EXPECT_EQ(map.at({0.025, 1.025}), CellClass::kOccupied);
  EXPECT_EQ(visibleAt(map.visible(), {0.025, 1.025}), Cell::kUnknown);
}

TEST(VisibleMap, FindsTheWallWithinTwoMillimetres) {
  for (const double front_m : {1.02, 1.05}) {  // within a row of cells, and on the border of two
    TwoWalls walls;
    walls.front_m = front_m;
    walls.noise_m = 0.003;
    const OccupancyMap map = mapFrom(driveAlong(walls, 5));
    int cells = 0;
    double normalised = 0.0;
    for (const structure::SurfaceCell& cell : map.visible().surface) {
      if (std::abs(cell.mean_m.x()) > 1.0) continue;
      // About 90 ends per cell: 0.3 mm. 2 mm is six times that.
      EXPECT_NEAR(cell.mean_m.y(), front_m, 0.002);
      EXPECT_GT(cell.observations, 6U);
      normalised += std::pow((cell.mean_m.y() - front_m) / cell.sigma_m, 2);
      ++cells;
    }
    EXPECT_GE(cells, 38);
    EXPECT_LT(normalised / cells, 2.0) << "the errors exceed the σ of the means";
  }
}

TEST(VisibleMap, ShowsOneRowOfCellsForAWallWithNoisyRanges) {
  TwoWalls walls;
  walls.front_m = 1.075;  // the middle of a row of cells: its borders are 1.4 σ away
  walls.noise_m = 0.018;
  const Observed all = driveAlong(walls, 3);
  const OccupancyMap map = mapFrom(all);
  const Numbers before = cellsBetween(map, 1.0, 1.05), wall = cellsBetween(map, 1.05, 1.1),
                behind = cellsBetween(map, 1.1, 1.15);
  EXPECT_GT(before.counted_occupied + behind.counted_occupied, 15) << "or the test shows nothing";
  EXPECT_EQ(wall.visible_occupied, 20);
  EXPECT_EQ(before.visible_occupied + behind.visible_occupied, 0);

  OccupancyOptions all_cells;
  all_cells.least_share = 0.0;
  const OccupancyMap noisy = mapFrom(all, all_cells);
  EXPECT_GT(cellsBetween(noisy, 1.0, 1.05).visible_occupied + cellsBetween(noisy, 1.1, 1.15).visible_occupied,
            5);

  walls.front_m = 1.05;  // on the border of two rows: half of the ends are in each
  const OccupancyMap border = mapFrom(driveAlong(walls, 3));
  EXPECT_GE(cellsBetween(border, 1.0, 1.05).visible_occupied, 18);
}

TEST(VisibleMap, UsesTheLatestThreeKeyframesOfOnePlace) {
  std::mt19937 random(1);
  OccupancyMap map({}, {});
  for (int k = 0; k < 5; ++k) {
    TwoWalls walls;
    walls.front_m = k < 2 ? 1.01 : 1.04;  // the same row of cells
    const Contribution seen = observe(walls, {0.01, 0.01, 0.0}, k, random);
    map.add(seen);
    map.add(standAt(seen, {0.01, 0.01, 0.0}));
  }
  int cells = 0;
  for (const structure::SurfaceCell& cell : map.visible().surface) {
    if (std::abs(cell.mean_m.x()) > 0.5) continue;
    EXPECT_EQ(cell.observations, 3U);
    EXPECT_NEAR(cell.mean_m.y(), 1.04, 2e-4);  // ranges are multiples of 0.1 mm
    ++cells;
  }
  EXPECT_GE(cells, 18);
}

// It has looked at the wall first, and elsewhere ever since.
TEST(VisibleMap, KeepsWhatAForwardCameraSawBeforeItTurnedInPlace) {
  std::mt19937 random(1);
  OccupancyMap map({}, {});
  for (int k = 0; k < 9; ++k) {
    const Pose2 at{0.01, 0.01, k < 3 ? M_PI / 2.0 : -M_PI / 2.0};
    Contribution seen = observe({}, at, k, random);
    for (int i = kRaysPerScan / 8; i < kRaysPerScan - kRaysPerScan / 8; ++i)
      seen.label[static_cast<std::size_t>(i)] = RayLabel::kInvalid;
    map.add(seen);
    map.add(standAt(seen, at));
  }
  EXPECT_GE(cellsBetween(map, 1.0, 1.05).visible_occupied, 18);
  EXPECT_GT(cellsBetween(map, 0.6, 1.0).visible_free, 50);
}

TEST(VisibleMap, MarksTheRobotsThatSawASurface) {
  std::mt19937 random(1);
  OccupancyMap map({}, {});
  for (const auto& [robot, side] : {std::pair{"r1", -1.0}, {"r2", 1.0}}) {
    const Pose2 at{0.6 * side, 0.0, 0.0};
    Contribution seen = observe({}, at, 0, random);
    seen.robot = robot;
    for (std::size_t i = 0; i < seen.range_dmm.size(); ++i) {  // each sees its side, and 0.2 m of the other
      const double x_m = at.x_m + 1e-4 * seen.range_dmm[i] * std::cos(2.0 * M_PI * i / kRaysPerScan);
      if (x_m * side < -0.2 && seen.label[i] == RayLabel::kObstacle) seen.label[i] = RayLabel::kInvalid;
    }
    map.add(seen);
    map.add(standAt(seen, at));
  }
  int cells = 0;
  for (const structure::SurfaceCell& cell : map.visible().surface) {
    const double x_m = cell.mean_m.x();
    if (std::abs(std::abs(x_m) - 0.2) < 0.05) continue;
    EXPECT_EQ(cell.observers, x_m < -0.2 ? 1U : x_m > 0.2 ? 2U : 3U) << x_m;
    ++cells;
  }
  EXPECT_GT(cells, 30);
}

TEST(VisibleMap, IsIndependentOfTheOrderOfContributions) {
  TwoWalls walls;
  walls.hole_to_m = 0.1;
  walls.noise_m = 0.004;
  walls.passes = [](int keyframe, int ray) { return keyframe % 4 == 3 || ray % 9 == 0; };
  Observed all = driveAlong(walls);
  const OccupancyMap reference = mapFrom(all);
  EXPECT_GT(reference.visible().surface.size(), 40U);
  for (unsigned seed = 1; seed <= 4; ++seed) {
    std::mt19937 random(seed);
    std::shuffle(all.contributions.begin(), all.contributions.end(), random);
    std::shuffle(all.poses.begin(), all.poses.end(), random);
    OccupancyMap map({}, {});
    for (std::size_t i = 0; i < all.poses.size(); ++i) {
      map.add(all.poses[i]);
      map.add(all.contributions[i]);
      map.visible();  // what was computed before must have no influence
    }
    expectSameMap(map.visible(), reference.visible());
    EXPECT_EQ(map.octreeBytes(), reference.octreeBytes());
  }
}

TEST(VisibleMap, IsTheSameAfterACorrectionAsWithTheRightPoses) {
  const Observed all = driveAlong({});
  const OccupancyMap reference = mapFrom(all);
  OccupancyMap map({}, {});
  for (std::size_t i = 0; i < all.poses.size(); ++i) {
    map.add(all.contributions[i]);
    KeyframePose wrong = all.poses[i];
    wrong.position.y_dmm += 3000;
    wrong.theta_dmrad += 700;
    map.add(wrong);
  }
  EXPECT_NE(map.visible().cells, reference.visible().cells);
  for (KeyframePose pose : all.poses) {
    pose.term = 1;
    map.add(pose);
  }
  expectSameMap(map.visible(), reference.visible());
  EXPECT_EQ(map.octreeBytes(), reference.octreeBytes());
}

}  // namespace
}  // namespace omnifleet::occupancy
