// Which cells a ray marks, by its label and its σ.

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "occupancy/occupancy_map.h"
#include "occupancy/ray_window.h"

namespace omnifleet::occupancy {
namespace {

constexpr std::int64_t kCellDmm = 500, kFarDmm = 30000;
constexpr int kCellsInRow = 24;

struct SingleRay {
  RayLabel label = RayLabel::kObstacle;
  std::int32_t range_dmm = 10000;
  std::uint16_t sigma_dmm = 0;
  std::uint16_t object = 0;
};

/// Four rays; the first one is given, the others show 0.4 m of floor.
Contribution scanWith(const SingleRay& ray, TimeNs time_ns = 0) {
  Contribution seen;
  seen.robot = "r1";
  seen.acquired_ns = time_ns;
  seen.range_dmm.assign(4, 4000);
  seen.sigma_dmm.assign(4, 0);
  seen.label.assign(4, RayLabel::kFloorEnd);
  seen.object.assign(4, 0);
  seen.range_dmm[0] = ray.range_dmm;
  seen.sigma_dmm[0] = ray.sigma_dmm;
  seen.label[0] = ray.label;
  seen.object[0] = ray.object;
  return seen;
}

/// A small robot in the middle of cell (0, 0) that looks along the row of cells y = 0.
OccupancyMap rowMap(const std::vector<SingleRay>& rays, OccupancyOptions options = {}) {
  options.robot_margin_m = 0.0;
  OccupancyMap map(options, {{"r1", RobotBody{0.001, {}, 0.1, 0.1}}});
  TimeNs time_ns = 0;
  for (const SingleRay& ray : rays) {
    map.add(scanWith(ray, time_ns));
    KeyframePose pose;
    pose.robot = "r1";
    pose.acquired_ns = time_ns;
    pose.valid = true;
    pose.position = {250, 250};
    map.add(pose);
    time_ns += 1000000000;
  }
  return map;
}

/// Cells 1 … 24 of the row by the counts: '.' free, '#' occupied, ' ' unknown.
std::string countedRow(const OccupancyMap& map) {
  std::string row;
  for (int x = 1; x <= kCellsInRow; ++x) {
    const CellClass found = map.at({0.05 * x + 0.025, 0.025});
    row += found == CellClass::kFree ? '.' : found == CellClass::kOccupied ? '#' : ' ';
  }
  return row;
}

/// The same of the visible cells.
std::string visibleRow(const OccupancyMap& map) {
  const structure::SurfaceMap& cells = map.visible();
  std::string row;
  for (int x = 1; x <= kCellsInRow; ++x) {
    const int u = x - static_cast<int>(std::lround(cells.origin_m.x() / cells.resolution_m)),
              v = -static_cast<int>(std::lround(cells.origin_m.y() / cells.resolution_m));
    if (u >= cells.width) {
      row += ' ';
      continue;
    }
    const structure::Cell found = cells.cells[static_cast<std::size_t>(u + v * cells.width)];
    row += found == structure::Cell::kFree ? '.' : found == structure::Cell::kOccupied ? '#' : ' ';
  }
  return row;
}

/// A row that begins with these cells.
std::string cellsOf(int unknown, int free, int unknown_after, bool is_hit) {
  std::string row = std::string(static_cast<std::size_t>(unknown), ' ') +
                    std::string(static_cast<std::size_t>(free), '.') +
                    std::string(static_cast<std::size_t>(unknown_after), ' ') + (is_hit ? "#" : "");
  row.resize(kCellsInRow, ' ');
  return row;
}

TEST(RayExtent, IsAHitUpToASigmaOfThreeQuartersOfACell) {
  const auto roleFor = [](std::uint16_t sigma_dmm, RayRole role) {
    const SingleRay ray{RayLabel::kObstacle, 10000, sigma_dmm, 0};
    return extentOf(scanWith(ray), 0, role, {kCellDmm, kFarDmm}).role;
  };
  for (const RayRole role : {RayRole::kHit, RayRole::kHitOnly, RayRole::kHitBeyond}) {
    EXPECT_EQ(roleFor(0, role), RayRole::kHit);
    EXPECT_EQ(roleFor(375, role), RayRole::kHit);
    EXPECT_EQ(roleFor(376, role), RayRole::kOpen);
  }
  EXPECT_EQ(roleFor(400, RayRole::kOpen), RayRole::kOpen);
  EXPECT_EQ(roleFor(400, RayRole::kFree), RayRole::kFree);
}

TEST(RayExtent, ShowsFloorUpToThreeSigmaBeforeItsEnd) {
  const auto extent = [](std::uint16_t sigma_dmm, RayRole role) {
    const SingleRay ray{RayLabel::kObstacle, 1000, sigma_dmm, 0};
    return extentOf(scanWith(ray), 0, role, {kCellDmm, kFarDmm});
  };
  EXPECT_EQ(extent(120, RayRole::kHit).range, 1000);
  EXPECT_EQ(extent(120, RayRole::kHit).free, 360);
  EXPECT_EQ(extent(1500, RayRole::kOpen).free, 1000);
  EXPECT_EQ(extent(120, RayRole::kFree).free, 0);
  EXPECT_EQ(extent(120, RayRole::kHitOnly).free, 1000) << "no floor before its end";
  EXPECT_EQ(extent(120, RayRole::kHitBeyond).free, 1000) << "not all of it is floor";
  EXPECT_FALSE(extent(120, RayRole::kHitOnly).at_floor);
  EXPECT_TRUE(extent(120, RayRole::kHitBeyond).at_floor);
  EXPECT_FALSE(extent(400, RayRole::kHitBeyond).at_floor) << "no hit";
  Contribution exact = scanWith({RayLabel::kObstacle, 1000, 0, 0});
  exact.sigma_dmm.clear();
  EXPECT_EQ(extentOf(exact, 0, RayRole::kHit, {kCellDmm, kFarDmm}).free, 0);
}

TEST(RayExtent, IsCutAtTheMaximumRangeWithoutAHit) {
  const RayExtent at =
      extentOf(scanWith({RayLabel::kObstacle, 30000, 0, 0}), 0, RayRole::kHit, {kCellDmm, kFarDmm});
  EXPECT_EQ(at.role, RayRole::kHit);
  const RayExtent cut =
      extentOf(scanWith({RayLabel::kObstacle, 30001, 0, 0}), 0, RayRole::kHit, {kCellDmm, kFarDmm});
  EXPECT_EQ(cut.role, RayRole::kFree);
  EXPECT_EQ(cut.range, kFarDmm);
}

/// What lies beyond the range may begin before it, within the σ of the end.
TEST(RayExtent, ShowsFloorBeforeTheRangeOnlyUpToThreeSigmaBeforeAFartherEnd) {
  const auto extent = [](std::uint16_t sigma_dmm) {
    return extentOf(scanWith({RayLabel::kObstacle, 30500, sigma_dmm, 0}), 0, RayRole::kHit,
                    {kCellDmm, kFarDmm});
  };
  EXPECT_EQ(extent(100).role, RayRole::kFree) << "3.05 m − 3 cm is beyond the range";
  EXPECT_EQ(extent(1000).role, RayRole::kOpen);
  EXPECT_EQ(extent(1000).range - extent(1000).free, 27500);
}

// The end at 1.025 m is in the middle of cell 20; that at 1.005 m is 0.5 cm behind the border of cell 20.

TEST(RayExtent, MarksFloorBeforeAHit) {
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 10000, 0, 0}})), cellsOf(0, 19, 0, true));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 10000, 250, 0}})), cellsOf(0, 18, 1, true));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 9800, 200, 0}})), cellsOf(0, 17, 2, true))
      << "a part of cell 18 is within three σ of the end";
}

TEST(RayExtent, MarksFloorUpToTheSigmasOfTheOptions) {
  OccupancyOptions options;
  options.free_sigmas = 1.0;
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 9800, 200, 0}}, options)), cellsOf(0, 18, 1, true));
  options.free_sigmas = 0.0;
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 9800, 200, 0}}, options)), cellsOf(0, 19, 0, true));
}

TEST(RayExtent, MarksOnlyFloorUpToThreeSigmaBeforeAVagueHit) {
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 10000, 376, 0}})), cellsOf(0, 17, 0, false));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 10000, 1000, 0}})), cellsOf(0, 13, 0, false));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kObstacle, 10000, 20000, 0}})), cellsOf(0, 0, 0, false));
}

TEST(RayExtent, MarksFloorIncludingTheEndOfAFloorRay) {
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kFloorEnd, 10000, 1000, 0}})), cellsOf(0, 20, 0, false));
}

TEST(RayExtent, LeavesAllBehindAnUndecidedRayUnknown) {
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUndecided, 10000, 0, 0}})), cellsOf(0, 19, 0, false));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUndecided, 10000, 1000, 0}})), cellsOf(0, 13, 0, false));
  EXPECT_EQ(visibleRow(rowMap({{RayLabel::kUndecided, 10000, 0, 0}})), cellsOf(0, 19, 0, false));
  // An undecided track shows as much floor, and no hit.
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUnknown, 10000, 0, 5}})), cellsOf(0, 19, 0, false));
}

TEST(RayExtent, MarksOnlyTheEndOfAHitWithoutAnEdge) {
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUnknown, 10000, 0, 0}})), cellsOf(19, 0, 0, true));
  // 2.5 cm (most_hit_sigma_m) is less than three quarters of a cell of 5 cm.
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUnknown, 10000, 250, 0}})), cellsOf(19, 0, 0, true));
  EXPECT_EQ(countedRow(rowMap({{RayLabel::kUnknown, 10000, 251, 0}})), cellsOf(0, 0, 0, false));
}

TEST(RayExtent, ShowsAHitWithoutAnEdgeOnlyBesideVisibleFloor) {
  const SingleRay hit{RayLabel::kUnknown, 10000, 0, 0};
  const OccupancyMap beside = rowMap({{RayLabel::kFloorEnd, 9500, 0, 0}, hit});
  EXPECT_EQ(countedRow(beside), cellsOf(0, 19, 0, true));
  EXPECT_EQ(visibleRow(beside), cellsOf(0, 19, 0, true));
  const OccupancyMap apart = rowMap({{RayLabel::kFloorEnd, 5000, 0, 0}, hit});
  EXPECT_EQ(countedRow(apart), cellsOf(0, 10, 9, true));
  EXPECT_EQ(visibleRow(apart), cellsOf(0, 10, 0, false));
}

}  // namespace
}  // namespace omnifleet::occupancy
