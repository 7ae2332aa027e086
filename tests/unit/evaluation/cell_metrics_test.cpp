#include "evaluation/cell_metrics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::evaluation {
namespace {

using Paths = std::map<std::string, TrueRobot>;

constexpr std::int8_t kUnknownCell = -1;

/// `side` × `side` cells of 5 cm, the lower-left corner of the first one at `corner_m` in x and y.
dataset::OccupancyGrid squareGrid(int side, double corner_m, std::int8_t value = kUnknownCell) {
  dataset::OccupancyGrid grid;
  grid.width = grid.height = side;
  grid.origin_m = {corner_m, corner_m};
  grid.cells.assign(static_cast<std::size_t>(side * side), value);
  return grid;
}

std::int8_t& cellAt(dataset::OccupancyGrid& grid, int x, int y) {
  return grid.cells[static_cast<std::size_t>(y * grid.width + x)];
}

/// Columns x0 to x1 and rows y0 to y1, both included.
void fill(dataset::OccupancyGrid& grid, int x0, int y0, int x1, int y1, std::int8_t value = 100) {
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) cellAt(grid, x, y) = value;
}

/// The border of a square of cells, from cell (low, low) to cell (high, high): 4·(high − low) cells.
void fillRing(dataset::OccupancyGrid& grid, int low, int high) {
  fill(grid, low, low, high, low);
  fill(grid, low, high, high, high);
  fill(grid, low, low, low, high);
  fill(grid, high, low, high, high);
}

Polygon box(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

dataset::MapObject objectOf(const Polygon& outline_m, const std::string& kind = "obstacle") {
  dataset::MapObject made;
  made.kind = kind;
  made.outline_m = outline_m;
  return made;
}

Paths robotAt(const std::vector<Eigen::Vector2d>& places) {
  Paths paths;
  auto& path = paths["r1"].path;
  for (const Eigen::Vector2d& place : places)
    path.push_back({static_cast<TimeNs>(path.size()), {place.x(), place.y(), 0.3}});
  return paths;
}

/// A room of 2 m × 2 m. Its walls run along the middle of the cells 2 and 42, so they cross 4 · 40 cells.
const Polygon kRoom = box(0.125, 0.125, 2.125, 2.125);
const Paths kInRoom = robotAt({{1.1, 1.15}});

// Every wall point lies in an occupied cell, every occupied cell is crossed, every free cell is inside.
TEST(CellMetrics, ReportsPerfectGridOfSquareRoom) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  fillRing(grid, 2, 42);
  fill(grid, 3, 3, 41, 41, 0);
  const CellMetrics m = compareCells(grid, {}, {}, {}, kRoom, kInRoom);
  EXPECT_EQ(m.occupied, 160);
  EXPECT_EQ(m.filled, 0);
  EXPECT_EQ(m.structure.cells, 160);
  EXPECT_EQ(m.all.cells, 160);
  EXPECT_EQ(m.structure.within_2cm, 1.0);
  EXPECT_EQ(m.structure.within_5cm, 1.0);
  EXPECT_EQ(m.structure.seen, 800) << "a perimeter of 8 m, one point per cm";
  EXPECT_EQ(m.structure.seen_occupied, 1.0);
  EXPECT_EQ(m.crossed, 160);
  EXPECT_EQ(m.occupied_per_crossed, 1.0);
  EXPECT_EQ(m.free, 39 * 39);
  EXPECT_EQ(m.free_wrong, 0.0);
  EXPECT_EQ(m.obstacles.cells, 0);
  EXPECT_EQ(m.obstacles.seen, 0);
  EXPECT_TRUE(std::isnan(m.obstacles.within_2cm));
  EXPECT_TRUE(std::isnan(m.obstacles.seen_occupied));
}

// The square of the ring inside begins 2.5 cm from the wall, that of the ring after it 7.5 cm.
TEST(CellMetrics, MeasuresDistanceFromSquareOfCell) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  fillRing(grid, 2, 42);  // 160 cells at 0 cm
  fillRing(grid, 3, 41);  // 152 cells at 2.5 cm
  fillRing(grid, 4, 40);  // 144 cells at 7.5 cm
  const CellMetrics m = compareCells(grid, {}, {}, {}, kRoom, kInRoom);
  EXPECT_DOUBLE_EQ(m.all.within_2cm, 160.0 / 456);
  EXPECT_DOUBLE_EQ(m.all.within_5cm, 312.0 / 456);
}

TEST(CellMetrics, CountsCellThreeCentimetresOffOnlyWithinFive) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0);
  cellAt(grid, 20, 21) = 100;  // its lower side is at 1.05 m
  const auto sharesAt = [&](double top_m) {
    const CellMetrics m = compareCells(grid, {}, {}, {objectOf(box(0.5, 0.5, 1.5, top_m))}, {}, {});
    return std::pair(m.obstacles.within_2cm, m.obstacles.within_5cm);
  };
  EXPECT_EQ(sharesAt(1.05), std::pair(1.0, 1.0)) << "touches the face";
  EXPECT_EQ(sharesAt(1.03), std::pair(1.0, 1.0)) << "2 cm off";
  EXPECT_EQ(sharesAt(1.02), std::pair(0.0, 1.0)) << "3 cm off";
  EXPECT_EQ(sharesAt(1.00), std::pair(0.0, 1.0)) << "5 cm off";
  EXPECT_EQ(sharesAt(0.99), std::pair(0.0, 0.0)) << "6 cm off";
  EXPECT_EQ(sharesAt(1.13), std::pair(0.0, 1.0)) << "3 cm off, inside";
}

TEST(CellMetrics, FindsFaceThatCrossesCellBetweenItsCorners) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0);
  cellAt(grid, 20, 20) = 100;  // 1 m to 1.05 m
  // The tip, 1 mm wide, ends at 1.2 m. It crosses the cell at mid-height; no corner is within 2 cm.
  const CellMetrics m =
      compareCells(grid, {}, {}, {objectOf({{0.5, 1.0245}, {1.2, 1.025}, {0.5, 1.0255}})}, {}, {});
  EXPECT_EQ(m.obstacles.within_2cm, 1.0);
}

TEST(CellMetrics, AttributesCellsToNearestFace) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  const std::vector<dataset::MapObject> scene{objectOf(box(1.025, 1.025, 1.225, 1.225)),
                                              objectOf(box(0.3, 0.3, 0.4, 0.4), "robot")};
  fill(grid, 20, 20, 20, 24);  // the obstacle's left side: 5 cells at 0 cm
  fill(grid, 19, 20, 19, 22);  // beside it: 3 cells 2.5 cm off
  fill(grid, 2, 10, 2, 16);    // the left wall: 7 cells at 0 cm
  fill(grid, 4, 10, 4, 12);    // 3 cells 7.5 cm off
  const CellMetrics m = compareCells(grid, {}, {}, scene, kRoom, {});
  EXPECT_EQ(m.obstacles.cells, 8);
  EXPECT_DOUBLE_EQ(m.obstacles.within_2cm, 5.0 / 8);
  EXPECT_DOUBLE_EQ(m.obstacles.within_5cm, 1.0);
  EXPECT_EQ(m.structure.cells, 10);
  EXPECT_DOUBLE_EQ(m.structure.within_2cm, 7.0 / 10);
  EXPECT_DOUBLE_EQ(m.structure.within_5cm, 7.0 / 10);
  EXPECT_DOUBLE_EQ(m.all.within_2cm, 12.0 / 18);
}

TEST(CellMetrics, AttributesCellToObstacleIfWallIsAsNear) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  cellAt(grid, 2, 20) = 100;  // crossed by the left wall and by the back of an obstacle that touches it
  const std::vector<dataset::MapObject> scene{objectOf(box(0.125, 0.825, 0.525, 1.225))};
  const CellMetrics m = compareCells(grid, {}, {}, scene, kRoom, {});
  EXPECT_EQ(m.obstacles.cells, 1);
  EXPECT_EQ(m.structure.cells, 0);
}

/// Walls at x = ±4 m and y = −4 m are out of reach. The wall at y = 1.5 m is within 1.8 m of the origin where
/// |x| < √(1.8² − 1.5²) = 0.995 m, and within 3 m where |x| < √(3² − 1.5²) = 2.598 m.
const Polygon kWideRoom = box(-4, -4, 4, 1.5);

TEST(CellMetrics, CountsFacesSeenWithinReach) {
  const CellMetrics m = compareCells(squareGrid(1, 0.0), {}, {}, {}, kWideRoom, robotAt({{0, 0}}));
  EXPECT_EQ(m.structure.seen, 2 * 99);  // 0.005 m to 0.985 m
  EXPECT_EQ(m.crossed, 2 * 52) << "also outside of the grid: |x| up to 2.595 m, 5 cm each";
}

// The front side of the obstacle hides the wall behind it: |x| < 0.1 m · 1.5 / 0.5 = 0.3 m. Its other sides
// are hidden by the front.
TEST(CellMetrics, ExcludesOccludedFaces) {
  const std::vector<dataset::MapObject> scene{objectOf(box(-0.1, 0.5, 0.1, 0.6))};
  const CellMetrics m = compareCells(squareGrid(1, 0.0), {}, {}, scene, kWideRoom, robotAt({{0, 0}}));
  EXPECT_EQ(m.structure.seen, 2 * (99 - 30));
  EXPECT_EQ(m.obstacles.seen, 20);
  EXPECT_EQ(m.all.seen, m.structure.seen + m.obstacles.seen);
  EXPECT_EQ(m.crossed, 2 * (52 - 6) + 4);
  const CellMetrics robot = compareCells(squareGrid(1, 0.0), {}, {}, {objectOf(scene[0].outline_m, "robot")},
                                         kWideRoom, robotAt({{0, 0}}));
  EXPECT_EQ(robot.structure.seen, 2 * 99) << "robots do not occlude";
}

TEST(CellMetrics, ExcludesFacesBehindWalls) {
  const std::vector<dataset::MapObject> scene{objectOf(box(-0.1, 1.6, 0.1, 1.7))};
  EXPECT_EQ(compareCells(squareGrid(1, 0.0), {}, {}, scene, kWideRoom, robotAt({{0, 0}})).obstacles.seen, 0);
  EXPECT_EQ(compareCells(squareGrid(1, 0.0), {}, {}, scene, {}, robotAt({{0, 0}})).obstacles.seen, 20);
}

// A board in front of the wall, 20 cm wide. Lines to the wall behind it are steep: 1 mm of depth is 1 mm of
// line.
TEST(CellMetrics, ToleratesFacesThreeMillimetresBeforeEndOfSight) {
  const auto seenBehind = [](double gap_m) {
    const std::vector<dataset::MapObject> scene{objectOf(box(-0.1, 1.5 - gap_m, 0.1, 1.5))};
    return compareCells(squareGrid(1, 0.0), {}, {}, scene, kWideRoom, robotAt({{0, 0}})).structure.seen;
  };
  EXPECT_EQ(seenBehind(0.002), 2 * 99);
  EXPECT_EQ(seenBehind(0.004), 2 * (99 - 10));
}

TEST(CellMetrics, UsesPositionsTenCentimetresApartOfAllRobots) {
  const auto seen = [](const Paths& paths) {
    return compareCells(squareGrid(1, 0.0), {}, {}, {}, kWideRoom, paths).structure.seen;
  };
  EXPECT_EQ(seen(robotAt({{0, 0}, {0.06, 0}})), 2 * 99);
  EXPECT_EQ(seen(robotAt({{0, 0}, {0.06, 0}, {0.1, 0}})), 2 * 99 + 10);
  Paths two = robotAt({{0, 0}});
  two["r2"].path.push_back({0, {0.06, 0, 0}});
  EXPECT_EQ(seen(two), 2 * 99 + 6) << "each robot has its own path";
}

// Of the 198 wall points seen, those at |x| ≤ 0.12 m are at most 2 cm from the occupied cells at |x| ≤ 0.1 m.
// Row 130 begins at 1.5 m.
TEST(CellMetrics, MeasuresShareOfSeenFacesThatIsOccupied) {
  dataset::OccupancyGrid grid = squareGrid(200, -5.0);
  fill(grid, 98, 130, 101, 130);
  EXPECT_DOUBLE_EQ(compareCells(grid, {}, {}, {}, kWideRoom, robotAt({{0, 0}})).structure.seen_occupied,
                   24.0 / 198);
  grid.origin_m.y() += 0.015;
  // 1.5 cm beyond the wall, the reach to the side is √(2² − 1.5²) = 1.32 cm: |x| = 0.105 m only.
  EXPECT_DOUBLE_EQ(compareCells(grid, {}, {}, {}, kWideRoom, robotAt({{0, 0}})).structure.seen_occupied,
                   22.0 / 198);
  grid.origin_m.y() += 0.006;
  EXPECT_EQ(compareCells(grid, {}, {}, {}, kWideRoom, robotAt({{0, 0}})).structure.seen_occupied, 0.0);
}

// A camera of 90° that looks along +y sees the wall at y = 1.5 m where |x| < 1.5 m; within 1.8 m that is all.
// One that looks along −y sees nothing of it.
TEST(CellMetrics, RestrictsForwardCamerasToTheirView) {
  const auto seenFrom = [](double theta_rad, double half_view_rad) {
    Paths robots;
    robots["r1"] = {{{0, {0.0, 0.0, theta_rad}}}, half_view_rad, {}};
    return compareCells(squareGrid(1, 0.0), {}, {}, {}, kWideRoom, robots).structure.seen;
  };
  EXPECT_EQ(seenFrom(M_PI / 2, M_PI / 4), 2 * 99);
  EXPECT_EQ(seenFrom(M_PI / 2, M_PI / 8), 2 * 62) << "|x| < 1.5 m · tan 22.5° = 0.621 m";
  EXPECT_EQ(seenFrom(-M_PI / 2, M_PI / 4), 0);
  EXPECT_EQ(seenFrom(M_PI / 2, 0.0), 0) << "no camera";
}

// A robot before the middle of the wall at y = 1.5 m, its body at |x| ≤ 0.1 m, y = 0.65 m to 0.85 m at time
// 0. Its front edge shadows |x| < 1.5 m · 0.1 / 0.65 = 0.231 m. From a height of 8.5 cm the foot of the wall
// is seen over its back edge if that is below 8.5 cm · (1 − 0.85 / 1.5) = 3.68 cm. At 4 cm it shadows |x| <
// 0.1 m / (1 − 4 / 8.5) = 0.189 m.
TEST(CellMetrics, HidesFeetOfFacesBehindOtherRobots) {
  const auto hidden = [](double body_height_m, double camera_height_m, TimeNs leaves_ns) {
    Paths robots;
    robots["r1"] = {{{0, {0.0, 0.0, M_PI / 2}}}, M_PI / 4, {}, 0.0, {}, camera_height_m};
    robots["r2"] = {{{-leaves_ns, {0.0, 0.75, 0.0}}, {-leaves_ns + 1'000'000, {0.0, -2.0, 0.0}}},
                    0.0,
                    box(-0.1, -0.1, 0.1, 0.1),
                    body_height_m};
    return 2 * 99 - compareCells(squareGrid(1, 0.0), {}, {}, {}, kWideRoom, robots).structure.seen;
  };
  EXPECT_EQ(hidden(0.2, 0.085, 0), 2 * 23);
  EXPECT_EQ(hidden(0.03, 0.085, 0), 0);
  EXPECT_EQ(hidden(0.04, 0.085, 0), 2 * 19);
  EXPECT_EQ(hidden(0.2, 0.085, 1'000'000), 0) << "at the time of the view it stands behind the camera";
  EXPECT_EQ(hidden(0.0, 0.085, 0), 0) << "a body of unknown height";
  EXPECT_EQ(hidden(0.2, 0.0, 0), 0) << "a camera of unknown height";
}

// From 0.3 m ahead of base_link, a camera of 45° sees |x| < (1.5 m − 0.3 m) · tan 22.5° = 0.497 m.
TEST(CellMetrics, LooksFromCameraNotFromBase) {
  Paths robots;
  robots["r1"] = {{{0, {0.0, 0.0, M_PI / 2}}}, M_PI / 8, {}, 0.0, {0.3, 0.0, 0.0}, 0.085};
  EXPECT_EQ(compareCells(squareGrid(1, 0.0), {}, {}, {}, kWideRoom, robots).structure.seen, 2 * 50);
}

// The wall at y = 2.125 m crosses row 42; the cells of row 43 lie 2.5 cm beyond it. The robot 0.5 m before
// the wall sees its middle 0.8 m to both sides from within 1 m: |x − 1.1| < √(1 − 0.525²) = 0.851 m.
TEST(CellMetrics, SeparatesErrorsOfNearAndFarFaces) {
  dataset::OccupancyGrid grid = squareGrid(46, 0.0);
  fill(grid, 15, 42, 30, 42);  // near, exact
  fill(grid, 4, 43, 4, 43);    // x = 0.225 m: farther than 1 m
  const CellMetrics m = compareCells(grid, {}, {}, {}, kRoom, robotAt({{1.1, 1.6}}));
  EXPECT_EQ(m.near_error_m, 0.0);
  EXPECT_NEAR(m.far_error_m, 0.025, 1e-9);
  EXPECT_NEAR(m.all.within_1_5cm, 16.0 / 17, 1e-9);
}

TEST(CellMetrics, CountsOccupiedCellsInBodiesOfRobots) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  fill(grid, 20, 20, 20, 20);  // 1.0 m to 1.05 m
  fill(grid, 30, 20, 30, 20);
  Paths robots;
  robots["r1"] = {{{0, {0.5, 1.0, 0.0}}, {1, {1.0, 1.0, 0.0}}}, M_PI, box(-0.08, -0.06, 0.08, 0.06)};
  EXPECT_EQ(compareCells(grid, {}, {}, {}, kRoom, robots).on_robots, 1);
}

// 39 × 39 cells lie wholly inside the walls of kRoom; half of the rows are free.
TEST(CellMetrics, MeasuresShareOfTheFloorThatIsFree) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0);
  fill(grid, 3, 3, 41, 22, 0);
  EXPECT_NEAR(compareCells(grid, {}, {}, {}, kRoom, {}).free_complete, 20.0 / 39, 1e-9);
}

/// Edges along the middle of cells: 20 × 10 cells, 56 of them crossed, 18 × 8 = 144 inside. A robot below it,
/// at (1 m, 0.3 m), sees the 20 cells of the front side only.
const Polygon kTable = box(0.525, 1.025, 1.475, 1.475);
const Paths kBelowTable = robotAt({{1.0, 0.3}});

TEST(CellMetrics, DividesThicknessByCrossedCells) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0);
  fill(grid, 10, 20, 29, 20);
  const CellMetrics thin = compareCells(grid, {}, {}, {objectOf(kTable)}, {}, kBelowTable);
  EXPECT_EQ(thin.crossed, 20);
  EXPECT_EQ(thin.occupied_per_crossed, 1.0);
  fill(grid, 10, 19, 29, 19);
  EXPECT_EQ(compareCells(grid, {}, {}, {objectOf(kTable)}, {}, kBelowTable).occupied_per_crossed, 2.0);
}

TEST(CellMetrics, LeavesOutFilledInteriorOfKnownOutline) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0);
  fill(grid, 10, 20, 29, 29);
  const std::vector<dataset::MapObject> scene{objectOf(kTable)};
  const CellMetrics known =
      compareCells(grid, {}, {objectOf(box(0.5, 1.0, 1.5, 1.5))}, scene, {}, kBelowTable);
  EXPECT_EQ(known.occupied, 200);
  EXPECT_EQ(known.filled, 144);
  EXPECT_EQ(known.all.cells, 56);
  EXPECT_EQ(known.all.within_2cm, 1.0);
  EXPECT_EQ(known.occupied_per_crossed, 56.0 / 20);
  // Unknown outlines, those of other kinds, and those that leave the cells out do not excuse them: all 200
  // count, 56 + 2·(18 + 6) = 104 of them within 5 cm.
  const std::vector<dataset::MapObject> others[] = {
      {}, {objectOf(kTable, "robot")}, {objectOf(kTable, "structure")}, {objectOf(box(3, 3, 4, 4))}};
  for (const auto& found : others) {
    const CellMetrics m = compareCells(grid, {}, found, scene, {}, kBelowTable);
    EXPECT_EQ(m.filled, 0);
    EXPECT_DOUBLE_EQ(m.all.within_2cm, 56.0 / 200);
    EXPECT_DOUBLE_EQ(m.all.within_5cm, 104.0 / 200);
    EXPECT_EQ(m.occupied_per_crossed, 200.0 / 20);
  }
}

TEST(CellMetrics, CountsFillOutsideTrueObstacle) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0);
  fill(grid, 10, 10, 29, 29);
  // The outline is 10 cells too long: those 200 cells are wrong.
  const CellMetrics m =
      compareCells(grid, {}, {objectOf(box(0.5, 0.5, 1.5, 1.5))}, {objectOf(kTable)}, {}, kBelowTable);
  EXPECT_EQ(m.filled, 144);
  EXPECT_EQ(m.all.cells, 256);
  EXPECT_DOUBLE_EQ(m.all.within_2cm, 56.0 / 256);
}

TEST(CellMetrics, MeasuresFreeAreaInsideObstaclesOrOutsideRoom) {
  dataset::OccupancyGrid grid = squareGrid(40, 0.0, 0);
  fill(grid, 0, 0, 39, 3, kUnknownCell);  // 1440 free cells are left
  const std::vector<dataset::MapObject> scene{objectOf(box(0.5, 0.5, 1.0, 0.9)),
                                              objectOf(box(1, 1, 2, 2), "robot")};
  const CellMetrics no_room = compareCells(grid, {}, {}, scene, {}, {});
  EXPECT_EQ(no_room.free, 1440);
  EXPECT_DOUBLE_EQ(no_room.free_wrong, 80.0 / 1440) << "10 × 8 cells";
  const CellMetrics room = compareCells(grid, {}, {}, scene, box(0, 0, 1.5, 2), {});
  EXPECT_DOUBLE_EQ(room.free_wrong, (80.0 + 360.0) / 1440) << "also 10 × 36 cells";
}

/// The polygon in another frame.
Polygon moved(const Pose2& pose, Polygon polygon) {
  for (Eigen::Vector2d& vertex : polygon) vertex = pose * vertex;
  return polygon;
}

TEST(CellMetrics, AlignsRunBeforeComparison) {
  dataset::OccupancyGrid grid = squareGrid(45, 0.0, 0);
  fillRing(grid, 2, 42);
  fill(grid, 10, 20, 29, 29);
  const Pose2 frame{3.0, -2.0, 0.7};
  const Eigen::Vector2d robot = frame * Eigen::Vector2d(1.0, 0.3);
  const CellMetrics m = compareCells(grid, frame, {objectOf(moved(frame, kTable))},
                                     {objectOf(moved(frame, kTable))}, moved(frame, kRoom), robotAt({robot}));
  const CellMetrics same = compareCells(grid, {}, {objectOf(kTable)}, {objectOf(kTable)}, kRoom, kBelowTable);
  EXPECT_EQ(same.filled, 144);
  EXPECT_EQ(m.filled, same.filled);
  EXPECT_EQ(m.all.within_2cm, 1.0);
  EXPECT_EQ(m.obstacles.seen, same.obstacles.seen);
  EXPECT_EQ(m.structure.seen, same.structure.seen);
  EXPECT_EQ(m.all.seen_occupied, 1.0);
  EXPECT_EQ(m.crossed, same.crossed);
  EXPECT_EQ(m.free_wrong, same.free_wrong);
}

TEST(CellMetrics, ReturnsNanWithoutCellsFacesOrPoses) {
  const CellMetrics nothing = compareCells({}, {}, {}, {}, {}, {});
  for (const double value : {nothing.all.within_2cm, nothing.all.within_5cm, nothing.all.seen_occupied,
                             nothing.occupied_per_crossed, nothing.free_wrong})
    EXPECT_TRUE(std::isnan(value));
  dataset::OccupancyGrid grid = squareGrid(10, 0.0);
  cellAt(grid, 5, 5) = 100;
  const CellMetrics no_faces = compareCells(grid, {}, {}, {}, {}, kInRoom);
  EXPECT_EQ(no_faces.occupied, 1);
  EXPECT_TRUE(std::isnan(no_faces.all.within_2cm));
  EXPECT_TRUE(std::isnan(no_faces.occupied_per_crossed));
  const CellMetrics no_poses = compareCells(grid, {}, {}, {}, kRoom, {{"r1", {}}});
  EXPECT_EQ(no_poses.structure.cells, 1);
  EXPECT_TRUE(std::isnan(no_poses.structure.seen_occupied));
  EXPECT_TRUE(std::isnan(no_poses.occupied_per_crossed));
}

}  // namespace
}  // namespace omnifleet::evaluation
