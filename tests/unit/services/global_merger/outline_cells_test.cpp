// What the occupied cells show at outlines: painted cells around rectangles.

#include "global_merger/outline_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace omnifleet::global_merger {
namespace {

constexpr double kPaintedCell_m = 0.05;

/// A rectangle, counter-clockwise, between multiples of a cell.
Polygon rectangleBetween(const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  return {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
}

/// 4 × 4 m around zero; cells are occupied where a function of their middle says so.
structure::SurfaceMap painted(const std::function<bool(const Eigen::Vector2d&)>& is_occupied) {
  structure::SurfaceMap map;
  map.resolution_m = kPaintedCell_m;
  map.origin_m = {-2.0, -2.0};
  map.width = map.height = 80;
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x)
      map.cells.push_back(is_occupied(map.origin_m + kPaintedCell_m * Eigen::Vector2d(x + 0.5, y + 0.5))
                              ? structure::Cell::kOccupied
                              : structure::Cell::kFree);
  return map;
}

/// Cells along the inner side of a rectangle.
bool isAtBorder(const Polygon& rectangle, const Eigen::Vector2d& at) {
  const Eigen::Vector2d low = at - rectangle[0], high = rectangle[2] - at;
  const double depth = std::min({low.x(), low.y(), high.x(), high.y()}) / kPaintedCell_m;
  return depth > 0.0 && depth < 1.0;
}

bool isBetween(const Eigen::Vector2d& at, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  return at.x() > low.x() && at.y() > low.y() && at.x() < high.x() && at.y() < high.y();
}

TEST(OutlineCells, HaveTheShareOfTheOutlineAtWhichRaysEnded) {
  const Polygon box = rectangleBetween({-0.5, -0.5}, {0.5, 0.5});
  const auto seen = [&](const std::function<bool(const Eigen::Vector2d&)>& is_occupied) {
    return cellsAt({box}, painted(is_occupied)).front().seen;
  };
  EXPECT_EQ(seen([&](const auto& at) { return isAtBorder(box, at); }), 1.0);
  EXPECT_EQ(seen([](const auto&) { return false; }), 0.0);
  // The cells of two sides of four. Their ends also reach 1.5 cells along the other sides: 2 × 1.5 of 80
  // cells.
  const double half = seen([&](const auto& at) { return isAtBorder(box, at) && at.x() + at.y() < -1e-9; });
  EXPECT_GT(half, 0.47);
  EXPECT_LT(half, 0.55);
}

TEST(OutlineCells, LieWithinOneAndAHalfCells) {
  const Polygon ring = rectangleBetween({-0.5, -0.5}, {0.5, 0.5});
  const structure::SurfaceMap map = painted([&](const auto& at) { return isAtBorder(ring, at); });
  // An outline around the ring: its distance from the middles of the cells is half a cell more.
  const auto around = [&](double away_m) {
    const double half_m = 0.5 + away_m;
    return cellsAt({rectangleBetween({-half_m, -half_m}, {half_m, half_m})}, map).front();
  };
  EXPECT_GT(around(0.045).seen, 0.9) << "all but its corners";
  EXPECT_EQ(around(0.055).seen, 0.0);
  EXPECT_EQ(around(0.055).alone, 1.0) << "no cells at the outline";
}

TEST(OutlineCells, AreAloneAtAFreeStandingBox) {
  const Polygon box = rectangleBetween({-0.2, -0.2}, {0.2, 0.2});
  const auto cells = cellsAt({box}, painted([&](const auto& at) {
                               return isAtBorder(box, at) || isBetween(at, {-2.0, 1.0}, {2.0, 1.05});
                             }));
  EXPECT_EQ(cells.front().alone, 1.0);
}

TEST(OutlineCells, AreNotAloneAtABoxAgainstAWall) {
  const Polygon box = rectangleBetween({-0.2, 0.6}, {0.2, 1.0});
  const auto with_wall = [&](double wall_m) {
    return cellsAt({box}, painted([&](const auto& at) {
                     return isAtBorder(box, at) || isBetween(at, {-1.5, wall_m}, {1.5, wall_m + 0.05});
                   }))
        .front();
  };
  // 28 cells of the box and at most 11 of the 60 of the wall are at the outline.
  EXPECT_EQ(with_wall(1.0).seen, 1.0);
  EXPECT_GT(with_wall(1.0).alone, 28.0 / 88.0 - 1e-9);
  EXPECT_LT(with_wall(1.0).alone, 39.0 / 88.0 + 1e-9);
  EXPECT_EQ(with_wall(1.1).alone, 1.0) << "a free row between them";
}

TEST(OutlineCells, AreConnectedAcrossCorners) {
  const Polygon box = rectangleBetween({-0.2, -0.2}, {0.2, 0.2});
  const auto cells = cellsAt({box}, painted([&](const auto& at) {
                               return isAtBorder(box, at) || isBetween(at, {0.2, 0.2}, {2.0, 0.25});
                             }));
  EXPECT_LT(cells.front().alone, 0.55) << "28 cells of the box, 36 that continue from its corner";
}

TEST(OutlineCells, ExplainEachOtherAtTwoTouchingBoxes) {
  const Polygon small = rectangleBetween({-0.3, -0.1}, {0.0, 0.1}),
                large = rectangleBetween({0.0, -0.5}, {1.0, 0.5});
  const structure::SurfaceMap map =
      painted([&](const auto& at) { return isAtBorder(small, at) || isAtBorder(large, at); });
  const auto both = cellsAt({small, large}, map);
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[0].alone, 1.0);
  EXPECT_EQ(both[1].alone, 1.0);
  EXPECT_LT(cellsAt({small}, map).front().alone, 0.5);
}

TEST(OutlineCells, AreNoneOfAnEmptyOutlineOrMap) {
  const Polygon box = rectangleBetween({-0.2, -0.2}, {0.2, 0.2});
  const auto cells = cellsAt({{}, box}, painted([&](const auto& at) { return isAtBorder(box, at); }));
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_EQ(cells[0].alone, 1.0);
  EXPECT_EQ(cells[1].seen, 1.0);
  EXPECT_EQ(cellsAt({box}, {}).size(), 1U);
  // An outline that reaches beyond the map.
  const Polygon outside = rectangleBetween({1.5, 1.5}, {2.5, 2.5});
  EXPECT_EQ(cellsAt({outside}, painted([](const auto&) { return false; })).front().seen, 0.0);
}

}  // namespace
}  // namespace omnifleet::global_merger
