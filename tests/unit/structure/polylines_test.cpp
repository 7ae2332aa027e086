// Polylines of surface maps against the faces of scenes in closed form.
#include "structure/polylines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "surface_scene.h"

namespace omnifleet::structure {
namespace {

using Eigen::Vector2d;
using testing::SurfaceScene;

constexpr double kDegree = M_PI / 180.0;
// Cells that no corner shares have means exactly on a face. Only the cells at the corners, with a small
// weight, pull a line off its face.
constexpr double kExact_m = 0.003;

const Polygon kRoom = testing::rectangle({0.013, 0.021}, 4.01, 3.03);

double distanceToFaces(const Vector2d& p, const std::vector<Polygon>& polygons) {
  double least = 1e9;
  for (const Polygon& polygon : polygons) {
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vector2d a = polygon[i], along = polygon[(i + 1) % polygon.size()] - a;
      const double share = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (p - a - share * along).norm());
    }
  }
  return least;
}

/// Largest distance of a vertex from the nearest vertex of the other polygon.
double vertexError(const std::vector<Vector2d>& found, const Polygon& truth) {
  double most = 0.0;
  for (const auto& [from, to] : {std::pair(&found, &truth), std::pair(&truth, &found)}) {
    for (const Vector2d& p : *from) {
      double least = 1e9;
      for (const Vector2d& q : *to) least = std::min(least, (p - q).norm());
      most = std::max(most, least);
    }
  }
  return most;
}

std::vector<Polyline> closedOf(const std::vector<Polyline>& lines) {
  std::vector<Polyline> closed;
  std::copy_if(lines.begin(), lines.end(), std::back_inserter(closed),
               [](const Polyline& l) { return l.closed; });
  return closed;
}

SurfaceScene boxSeenAllAround(double angle_rad) {
  return {kRoom,
          {testing::rectangle({0.1, -0.05}, 0.62, 0.41, angle_rad)},
          {{-1.5, -1.0}, {1.5, -1.0}, {1.5, 1.1}, {-1.5, 1.1}}};
}

TEST(Polylines, ReturnARoomAsAnOpenRingFromInside) {
  // A box stands against the upper wall.
  const Polygon truth{{-1.992, -1.494}, {2.018, -1.494}, {2.018, 1.536}, {0.913, 1.536},
                      {0.913, 0.987},   {0.211, 0.987},  {0.211, 1.536}, {-1.992, 1.536}};
  const SurfaceScene scene{truth, {}, {{-1.0, 0.0}, {1.5, 0.0}}};
  const std::vector<Polyline> lines = polylinesOf(scene.map(), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].closed);
  ASSERT_EQ(lines[0].points_m.size(), 9U);
  EXPECT_EQ(lines[0].points_m.front(), lines[0].points_m.back());
  EXPECT_LT(vertexError(lines[0].points_m, truth), kExact_m);
  EXPECT_LT(signedArea(lines[0].points_m), 0.0);  // clockwise: free space is on the right side
}

TEST(Polylines, CloseABoxSeenAllAround) {
  for (int degrees = 0; degrees < 90; degrees += 3) {
    const SurfaceScene scene = boxSeenAllAround(degrees * kDegree);
    const std::vector<Polyline> lines = polylinesOf(scene.map(), {}), closed = closedOf(lines);
    EXPECT_EQ(lines.size(), 2U) << degrees;  // the room and the box
    ASSERT_EQ(closed.size(), 1U) << degrees;
    EXPECT_EQ(closed[0].points_m.size(), 4U) << degrees;
    EXPECT_LT(vertexError(closed[0].points_m, scene.obstacles[0]), kExact_m) << degrees;
    EXPECT_GT(signedArea(closed[0].points_m), 0.0) << degrees;
  }
}

TEST(Polylines, KeepTheCornersOfASmallBox) {
  // The mean of a corner's cell lies inside the corner, which looks cut off.
  SurfaceScene scene = boxSeenAllAround(0.0);
  scene.obstacles = {testing::rectangle({0.051584, 0.037592}, 0.214827, 0.162793, 2.55724)};
  const std::vector<Polyline> closed = closedOf(polylinesOf(scene.map(), {}));
  ASSERT_EQ(closed.size(), 1U);
  EXPECT_EQ(closed[0].points_m.size(), 4U);
  // Most cells of so short a face are at a corner, where means are up to a quarter of a cell off: 12.5 mm. A
  // corner that is cut off is 34 mm away.
  EXPECT_LT(vertexError(closed[0].points_m, scene.obstacles[0]), 0.0125);
}

TEST(Polylines, LeaveABoxSeenFromOneSideOpen) {
  for (int degrees = 0; degrees < 90; degrees += 5) {
    SurfaceScene scene = boxSeenAllAround(degrees * kDegree);
    scene.viewpoints = {{-1.5, -1.0}};
    const std::vector<Polyline> lines = polylinesOf(scene.map(), {});
    EXPECT_TRUE(closedOf(lines).empty()) << degrees;
    int at_box = 0;
    for (const Polyline& line : lines) {
      at_box += distanceToFaces(line.points_m.front(), scene.obstacles) < 0.1 ? 1 : 0;
      EXPECT_NE(line.points_m.front(), line.points_m.back());
      for (const Vector2d& p : line.points_m)
        EXPECT_LT(distanceToFaces(p, {kRoom, scene.obstacles[0]}), kExact_m) << degrees;
    }
    EXPECT_EQ(at_box, 1) << degrees;
  }
}

TEST(Polylines, CloseARoundPillarWithItsArea) {
  for (const double radius_m : {0.1, 0.15, 0.25, 0.5}) {
    SurfaceScene scene = boxSeenAllAround(0.0);
    scene.obstacles = {circlePolygon({0.117, -0.043}, radius_m, 120)};
    const std::vector<Polyline> closed = closedOf(polylinesOf(scene.map(), {}));
    ASSERT_EQ(closed.size(), 1U) << radius_m;
    const double area = M_PI * radius_m * radius_m;
    EXPECT_NEAR(signedArea(closed[0].points_m), area, 0.05 * area) << radius_m;
  }
}

TEST(Polylines, EndWhereABoxEntersTheUnknown) {
  SurfaceScene scene = boxSeenAllAround(20.0 * kDegree);
  SurfaceMap map = scene.map();
  testing::hideBeyond(map, 0.1);
  const std::vector<Polyline> lines = polylinesOf(map, {});
  EXPECT_TRUE(closedOf(lines).empty());
  ASSERT_EQ(lines.size(), 2U);
  for (const Polyline& line : lines) {
    // Both ends lie at the edge of the unknown area.
    EXPECT_NEAR(line.points_m.front().x(), 0.1, 0.06);
    EXPECT_NEAR(line.points_m.back().x(), 0.1, 0.06);
    EXPECT_GT((line.points_m.front() - line.points_m.back()).norm(), 0.2);
    for (const Vector2d& p : line.points_m)
      EXPECT_LT(distanceToFaces(p, {kRoom, scene.obstacles[0]}), kExact_m);
  }
}

TEST(Polylines, AverageTheNoiseOfTheMeans) {
  constexpr double kNoise_m = 0.005;
  double squares = 0.0;
  int middles = 0, corners = 0;
  constexpr int kSeeds = 40;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const SurfaceScene scene = boxSeenAllAround(seed * 2.0 * kDegree);
    for (const Polyline& line : polylinesOf(scene.map(0.05, kNoise_m, seed), {})) {
      corners += static_cast<int>(line.points_m.size()) - (line.closed ? 0 : 1);
      for (std::size_t i = 0; i + 1 < line.points_m.size(); ++i) {
        const double error =
            distanceToFaces(0.5 * (line.points_m[i] + line.points_m[i + 1]), {kRoom, scene.obstacles[0]});
        squares += error * error, ++middles;
      }
    }
  }
  // The least certain faces have 8 cells: 5 mm ÷ √8 = 1.8 mm.
  EXPECT_LT(std::sqrt(squares / middles), 0.0018);
  // Few false corners: room and box have 8.
  EXPECT_NEAR(corners, 8 * kSeeds, 0.1 * 8 * kSeeds);
}

TEST(Polylines, WeightCellsByTheirSigma) {
  // Every third mean of the wall is 10 mm off and reports it.
  const SurfaceScene scene{kRoom, {}, {{0, 0}}};
  SurfaceMap map = scene.map();
  for (SurfaceCell& cell : map.surface) {
    cell.sigma_m = 0.001;
    if ((cell.x + cell.y) % 3 != 0) continue;
    cell.mean_m *= 0.995;  // up to 10 mm inwards
    cell.sigma_m = 0.01;
  }
  const std::vector<Polyline> lines = polylinesOf(map, {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_LT(vertexError(lines[0].points_m, kRoom), kExact_m);
  EXPECT_NEAR(lines[0].sigma_m, 0.001, 1e-4) << "the cells scatter little about the line";
}

TEST(Polylines, HaveNoCornersAlongAStraightWall) {
  // Douglas–Peucker begins with a corner every 100 cells; these walls have 240 and 60.
  const SurfaceScene scene{testing::rectangle({0.013, 0.021}, 12.01, 3.03), {}, {{-4, 0}, {0, 0}, {4, 0}}};
  const std::vector<Polyline> lines = polylinesOf(scene.map(0.05, 0.002), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].points_m.size(), 5U);
}

TEST(Polylines, SetCornersWhereTheyExceedTheTolerance) {
  // A step of 60 mm in the upper wall.
  const Polygon steps{{-1.992, -1.494}, {2.018, -1.494}, {2.018, 1.536},
                      {0.513, 1.536},   {0.513, 1.476},  {-1.992, 1.476}};
  const SurfaceScene scene{steps, {}, {{1.0, 0.0}, {-1.0, 0.0}}};
  PolylineOptions rough;
  rough.tolerance_m = 0.1;
  EXPECT_EQ(polylinesOf(scene.map(), {}).at(0).points_m.size(), 7U);
  EXPECT_EQ(polylinesOf(scene.map(), rough).at(0).points_m.size(), 5U);
  // The same with means that are that uncertain.
  SurfaceMap map = scene.map();
  for (SurfaceCell& cell : map.surface) cell.sigma_m = 0.025;
  EXPECT_EQ(polylinesOf(map, {}).at(0).points_m.size(), 5U);
}

TEST(Polylines, PassAProtrudingCellOnce) {
  const std::vector<Polyline> lines = polylinesOf(testing::drawing({"........", "...#....", "########"}), {});
  ASSERT_EQ(lines.size(), 1U);
  const std::vector<Vector2d>& points = lines[0].points_m;
  const auto isTip = [](const Vector2d& p) { return (p - Vector2d(0.35, 0.15)).norm() < 0.01; };
  EXPECT_EQ(std::count_if(points.begin(), points.end(), isTip), 1);
  // The cell below the tip is in the line once: it returns on another way.
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) length += (points[i + 1] - points[i]).norm();
  EXPECT_LT(length, 0.3 + 0.1 + std::sqrt(2.0) * 0.1 + 0.3 + 0.001);
}

TEST(Polylines, OmitSmallGroupsOfCells) {
  const std::vector<std::string> one{".....", ".....", "..#..", ".....", "....."};
  const std::vector<std::string> two{".....", ".....", "..##.", ".....", "....."};
  const std::vector<std::string> four{".....", ".##..", ".##..", ".....", "....."};
  EXPECT_TRUE(polylinesOf(testing::drawing(one), {}).empty());
  EXPECT_TRUE(polylinesOf(testing::drawing(two), {}).empty());
  const std::vector<Polyline> lines = polylinesOf(testing::drawing(four), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_TRUE(lines[0].closed);
  EXPECT_NEAR(signedArea(lines[0].points_m), 0.01, 1e-9);
}

TEST(Polylines, BridgeAGapOfOneCell) {
  const std::vector<std::string> occupied{"........", ".######.", ".#....#.", ".##o###.", "........"};
  const std::vector<std::string> unknown{"........", ".######.", ".#    #.", ".## ###.", "........"};
  const std::vector<std::string> wide{"........", ".######.", ".#    #.", ".##  ##.", "........"};
  PolylineOptions strict;
  strict.max_gap_cells = 0;
  for (const auto& rows : {occupied, unknown}) {
    const SurfaceMap map = testing::drawing(rows);
    EXPECT_EQ(closedOf(polylinesOf(map, {})).size(), 1U);
    EXPECT_TRUE(closedOf(polylinesOf(map, strict)).empty());
  }
  const std::vector<Polyline> lines = polylinesOf(testing::drawing(wide), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].closed);
  // It begins and ends beside the gap, and every cell between is part of it.
  EXPECT_LT((lines[0].points_m.front() - Vector2d(0.55, 0.15)).norm(), 0.001);
  EXPECT_LT((lines[0].points_m.back() - Vector2d(0.25, 0.15)).norm(), 0.001);
}

TEST(Polylines, TreatTheMapsEdgeAsUnknown) {
  const std::vector<Polyline> lines = polylinesOf(testing::drawing({"####", "#...", "#...", "#..."}), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].closed);
  ASSERT_EQ(lines[0].points_m.size(), 3U);
  // Free space is on the right side: up along the left wall, then to the right.
  EXPECT_LT((lines[0].points_m[0] - Vector2d(0.05, 0.05)).norm(), 0.001);
  EXPECT_LT((lines[0].points_m[1] - Vector2d(0.05, 0.35)).norm(), 0.001);
  EXPECT_LT((lines[0].points_m[2] - Vector2d(0.35, 0.35)).norm(), 0.001);
}

TEST(Polylines, SeparateFreeAreasAtADiagonalWall) {
  // The wall joins its cells by their corners. Both areas see it, each from its side.
  const std::vector<Polyline> lines =
      polylinesOf(testing::drawing({"#.....", ".#....", "..#...", "...#..", "....#.", ".....#"}), {});
  ASSERT_EQ(lines.size(), 2U);
  for (const Polyline& line : lines) {
    EXPECT_FALSE(line.closed);
    ASSERT_EQ(line.points_m.size(), 2U);
    EXPECT_NEAR((line.points_m[0] - line.points_m[1]).norm(), 0.5 * std::sqrt(2.0), 0.001);
  }
  EXPECT_LT((lines[0].points_m.front() - lines[1].points_m.back()).norm(), 0.001);
}

TEST(Polylines, ReturnAThinPanelAsALine) {
  const std::vector<Polyline> lines =
      polylinesOf(testing::drawing({".........", ".........", ".#######.", ".........", "........."}), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].closed);
  ASSERT_EQ(lines[0].points_m.size(), 2U);
  EXPECT_NEAR((lines[0].points_m[0] - lines[0].points_m[1]).norm(), 0.6, 1e-9);
}

TEST(Polylines, ReturnAnAngledThinPanelAsALine) {
  const std::vector<Polyline> lines =
      polylinesOf(testing::drawing({".........", ".#.......", ".#.......", ".#.......", ".#.......",
                                    ".#######.", "........."}),
                  {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_FALSE(lines[0].closed);
  ASSERT_EQ(lines[0].points_m.size(), 3U);
  EXPECT_LT((lines[0].points_m[1] - Vector2d(0.15, 0.15)).norm(), 0.001);
}

TEST(Polylines, EndOnTheFittedLine) {
  SurfaceMap map = testing::drawing({"##########", ".........."});
  for (SurfaceCell& cell : map.surface)
    if (cell.x == 0 || cell.x == 9) cell.mean_m.y() += cell.x == 0 ? 0.006 : -0.006;
  const std::vector<Polyline> lines = polylinesOf(map, {});
  ASSERT_EQ(lines.size(), 1U);
  ASSERT_EQ(lines[0].points_m.size(), 2U);
  for (const Vector2d& p : lines[0].points_m) EXPECT_LT(std::abs(p.y() - 0.15), 0.004);
}

TEST(Polylines, FollowAThinWallIntoTheRoomAndBack) {
  const std::vector<Polyline> lines =
      polylinesOf(testing::drawing({"##########", "#........#", "#........#", "#........#", "#######..#",
                                    "#........#", "#........#", "#........#", "##########"}),
                  {});
  ASSERT_EQ(lines.size(), 1U);
  const std::vector<Vector2d>& points = lines[0].points_m;
  EXPECT_EQ(points.front(), points.back());
  const Vector2d tip(0.65, 0.45);
  EXPECT_EQ(
      std::count_if(points.begin(), points.end(), [&](const auto& p) { return (p - tip).norm() < 0.01; }), 1);
  // The wall adds no area.
  EXPECT_NEAR(signedArea(points), -0.9 * 0.8, 0.01);
}

TEST(Polylines, IgnoreFreeSpecksInsideAnIsland) {
  const std::vector<std::string> specks{".........", ".#######.", ".#     #.", ".# ### #.", ".# #.# #.",
                                        ".# ### #.", ".#     #.", ".#######.", "........."};
  const std::vector<Polyline> lines = polylinesOf(testing::drawing(specks), {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_TRUE(lines[0].closed);
  EXPECT_NEAR(signedArea(lines[0].points_m), 0.36, 0.01);
  PolylineOptions all;
  all.least_free_cells = 1;
  EXPECT_EQ(polylinesOf(testing::drawing(specks), all).size(), 2U);
}

TEST(Polylines, ReportTheObserversOfTheirCells) {
  SurfaceMap map = testing::drawing({"......", ".####.", ".####.", "......"});
  for (std::size_t i = 0; i < map.surface.size(); ++i) {
    map.surface[i].observers = i == 2 ? 4 : 1;
    map.surface[i].observations = i < 5 ? 7 : 100;
    map.surface[i].sigma_m = i < 5 ? 0.003 : 0.001;
  }
  const std::vector<Polyline> lines = polylinesOf(map, {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].observers, 5U);
  EXPECT_EQ(lines[0].observations, 7U);
  EXPECT_EQ(lines[0].sigma_m, 0.003);
}

TEST(Polylines, AreEqualForAnyOrderOfTheSurface) {
  SurfaceScene scene = boxSeenAllAround(20.0 * kDegree);
  scene.viewpoints.pop_back();
  SurfaceMap map = scene.map(0.05, 0.003);
  const std::vector<Polyline> lines = polylinesOf(map, {});
  ASSERT_GE(lines.size(), 2U);
  std::mt19937 random(1);
  for (int turn = 0; turn < 5; ++turn) {
    std::shuffle(map.surface.begin(), map.surface.end(), random);
    const std::vector<Polyline> again = polylinesOf(map, {});
    ASSERT_EQ(again.size(), lines.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      EXPECT_EQ(again[i].points_m, lines[i].points_m);
      EXPECT_EQ(again[i].closed, lines[i].closed);
      EXPECT_EQ(again[i].sigma_m, lines[i].sigma_m);
    }
  }
}

TEST(Polylines, AreOrderedByTheirFirstCell) {
  const std::vector<Polyline> lines =
      polylinesOf(testing::drawing({"..........", ".##....##.", ".##....##.", "..........", "....##....",
                                    "....##....", ".........."}),
                  {});
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_LT(lines[0].points_m[0].y(), 0.3);
  EXPECT_LT(lines[1].points_m[0].x(), 0.4);
  EXPECT_GT(lines[2].points_m[0].x(), 0.6);
}

TEST(Polylines, AreEmptyForAnEmptyMap) {
  EXPECT_TRUE(polylinesOf(SurfaceMap{}, {}).empty());
  EXPECT_TRUE(polylinesOf(testing::drawing({"....", "....", "...."}), {}).empty());
}

TEST(Polylines, IgnoreEntriesOfOtherCells) {
  SurfaceMap map = testing::drawing({"######", "#....#", "#....#", "##  ##"});
  const std::vector<Polyline> lines = polylinesOf(map, {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].points_m.front(), lines[0].points_m.back());
  map.surface.push_back({2, 0, {0.25, 0.05}, 0.001, 1, 1});  // unknown
  map.surface.push_back({3, 0, {0.35, 0.05}, 0.001, 1, 1});
  map.surface.push_back({-1, 2, {5, 5}, 0.001, 1, 1});  // outside
  map.surface.push_back({6, 1, {5, 5}, 0.001, 1, 1});
  map.surface.push_back({100, 99, {5, 5}, 0.001, 1, 1});
  const std::vector<Polyline> again = polylinesOf(map, {});
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(again[0].points_m, lines[0].points_m);
}

TEST(PolylineOptions, RejectUnknownKeysAndBounds) {
  const auto read = [](const std::string& text) {
    return PolylineOptions::read(options::Section::parse(text, "f.yaml"));
  };
  const PolylineOptions o = read("tolerance_m: 0.02\nleast_cells: 5\nmax_gap_cells: 2\n");
  EXPECT_EQ(o.tolerance_m, 0.02);
  EXPECT_EQ(o.least_cells, 5);
  EXPECT_EQ(o.max_gap_cells, 2);
  EXPECT_THROW(read("tolerance: 0.02\n"), options::Error);
  EXPECT_THROW(read("least_cells: 1\n"), options::Error);
}

}  // namespace
}  // namespace omnifleet::structure
