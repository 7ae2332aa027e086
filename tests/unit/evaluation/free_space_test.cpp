#include "evaluation/free_space.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::evaluation {
namespace {

/// 40 × 20 cells of 5 cm from (0, 0): 2 m × 1 m, all free.
dataset::OccupancyGrid freeGrid() {
  dataset::OccupancyGrid grid;
  grid.width = 40;
  grid.height = 20;
  grid.cells.assign(800, 0);
  return grid;
}

Polygon rectangle(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

dataset::MapObject object(const std::string& kind, const Polygon& outline_m) {
  dataset::MapObject made;
  made.kind = kind;
  made.outline_m = outline_m;
  return made;
}

// Areas are exact along the borders of the cells.
TEST(FreeSpace, MeasuresFreeAreaInsideObstaclesAndOutsideRoom) {
  const auto m = compareFreeSpace(
      freeGrid(), {},
      {object("obstacle", rectangle(0.2, 0.2, 0.5, 0.4)), object("robot", rectangle(1, 0, 2, 1))},
      rectangle(0, 0, 1.5, 1));
  EXPECT_NEAR(m.free_m2, 2.0, 1e-9);
  EXPECT_NEAR(m.in_obstacles_m2, 0.3 * 0.2, 1e-9);
  ASSERT_TRUE(m.outside_m2);
  EXPECT_NEAR(*m.outside_m2, 0.5, 1e-9);
}

TEST(FreeSpace, IgnoresOccupiedAndUnknownCells) {
  dataset::OccupancyGrid grid = freeGrid();
  for (std::size_t i = 0; i < 800; ++i)
    if (i % 40 >= 30) grid.cells[i] = i % 2 == 0 ? 100 : -1;
  const auto m =
      compareFreeSpace(grid, {}, {object("obstacle", rectangle(1.5, 0, 2, 1))}, rectangle(0, 0, 1.5, 1));
  EXPECT_EQ(m.in_obstacles_m2, 0.0);
  EXPECT_EQ(m.outside_m2.value(), 0.0);
  EXPECT_NEAR(m.free_m2, 1.5, 1e-9);
}

TEST(FreeSpace, AlignsRunBeforeComparison) {
  const auto m = compareFreeSpace(freeGrid(), {10.0, 5.0, M_PI_2}, {}, rectangle(9, 5, 10, 6));
  EXPECT_NEAR(m.outside_m2.value(), 1.0, 1e-9) << "in the truth the grid spans x 9 to 10, y 5 to 7";
}

TEST(FreeSpace, FindsWallsWithOccupiedCells) {
  dataset::OccupancyGrid grid = freeGrid();
  EXPECT_EQ(compareFreeSpace(grid, {}, {}, rectangle(0, 0, 2, 1)).walls_found.value(), 0.0);
  for (std::size_t i = 0; i < 40; ++i) grid.cells[i] = 100;  // y < 5 cm
  // Found are the side along x (2 m of 6 m) and parts of both sides next to it: points up to √(15² − 2.5²) =
  // 14.8 cm above the centres of those cells at 2.5 cm, i.e. below 17.3 cm. Points are 5 cm apart, at 2.5,
  // 7.5, 12.5 and 17.5 cm, so three per side.
  EXPECT_NEAR(compareFreeSpace(grid, {}, {}, rectangle(0, 0, 2, 1)).walls_found.value(), (40 + 2 * 3) / 120.0,
              1e-9);
}

TEST(FreeSpace, ReturnsNoWallsWithoutRoom) {
  const auto m = compareFreeSpace(freeGrid(), {}, {}, {});
  EXPECT_FALSE(m.outside_m2);
  EXPECT_FALSE(m.walls_found);
}

}  // namespace
}  // namespace omnifleet::evaluation
