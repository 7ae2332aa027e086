#include "laser/segments.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/laser/room.h"

namespace omnifleet::laser {
namespace {

std::vector<Segment> cut(const Beams& beams) {
  std::vector<Segment> found;
  segments(beams, 0.005, {}, found);
  return found;
}

Beams beamsOf(const dataset::LaserRow& row, double range_max_m = 6.0) {
  dataset::LaserSensor sensor;
  sensor.range_max_m = range_max_m;
  sensor.range_sigma_m = 0.005;
  Beams beams;
  beams.set(row, sensor);
  return beams;
}

TEST(Segments, ReturnsClosedRoomAsOneSurface) {
  test::Room room;
  room.polygons.push_back(test::box({0.2, -0.1}, {4.0, 3.0}, 0.1));
  const auto found = cut(beamsOf(room.scan(720)));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].count, 720u);
  EXPECT_FALSE(found[0].hidden_before || found[0].hidden_after);
}

/// A box in front of the wall, and one across the seam of the scan (behind the robot): three surfaces.
TEST(Segments, SeparatesBoxesFromTheWall) {
  test::Room room;
  room.polygons = {test::box({0.0, 0.0}, {5.0, 5.0}, 0.0), test::box({1.2, 0.0}, {0.3, 0.3}, 0.3),
                   test::box({-1.0, 0.0}, {0.2, 0.4}, 0.0)};
  const Beams beams = beamsOf(room.scan(720, 0.005));
  const auto found = cut(beams);
  ASSERT_EQ(found.size(), 4u) << "the boxes cut the wall in two";
  int free_ends = 0;
  std::size_t behind = 0;
  for (const Segment& s : found) {
    free_ends += !s.hidden_before && !s.hidden_after ? 1 : 0;
    // The box behind the robot spans 2·atan(0.2/0.9) = 25.06°, 50 beams at 0.5°.
    if (std::abs(beams.at(s.first + s.count / 2).point_m.x() + 0.9) < 0.02) behind = s.count;
  }
  EXPECT_EQ(free_ends, 2) << "the ends of the boxes are visible, the wall continues behind them";
  EXPECT_NEAR(static_cast<double>(behind), 50.1, 1.0);
}

TEST(Segments, MarksPartlyHiddenSurface) {
  test::Room room;
  room.discs.push_back({{1.0, 0.2}, 0.1});
  room.polygons = {test::box({2.0, 0.0}, {0.2, 1.6}, 0.0)};
  const Beams beams = beamsOf(room.scan(720));
  const auto found = cut(beams);
  ASSERT_EQ(found.size(), 3u) << "the farther box is visible on both sides of the nearer one";
  for (const Segment& s : found) {
    const bool near = beams.at(s.first).range_m < 1.3;
    EXPECT_EQ(s.hidden_before || s.hidden_after, !near);
  }
}

/// No echo within a known maximum range means free. With an unknown maximum range it means unknown.
TEST(Segments, TreatsNoEchoAsFreeOnlyWithKnownRange) {
  test::Room room;
  room.discs.push_back({{1.0, 0.0}, 0.1});
  EXPECT_EQ(beamsOf(room.scan(360)).at(0).echo, Echo::kNone);
  EXPECT_EQ(beamsOf(room.scan(360), 0.0).at(0).echo, Echo::kBlind);
  EXPECT_FALSE(cut(beamsOf(room.scan(360)))[0].hidden_before);
  EXPECT_TRUE(cut(beamsOf(room.scan(360), 0.0))[0].hidden_before);
}

/// The end of the field of view cuts an object. The same scan in clockwise order gives the same result.
TEST(Segments, HandlesClockwiseScansAndEndOfView) {
  test::Room room;
  room.discs.push_back({{0.0, 1.0}, 0.2});
  dataset::LaserRow row;
  row.angle_min_rad = -M_PI_2;
  row.angle_increment_rad = M_PI / 360.0;
  for (int i = 0; i <= 360; ++i)
    row.range_m.push_back(static_cast<float>(room.distance(row.angle_min_rad + i * row.angle_increment_rad)));
  dataset::LaserRow clockwise = row;
  clockwise.angle_min_rad = M_PI_2;
  clockwise.angle_increment_rad = -row.angle_increment_rad;
  std::reverse(clockwise.range_m.begin(), clockwise.range_m.end());
  for (const auto& given : {row, clockwise}) {
    const Beams beams = beamsOf(given);
    const auto found = cut(beams);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_FALSE(found[0].hidden_before);
    EXPECT_TRUE(found[0].hidden_after);
    EXPECT_NEAR(beams.at(found[0].first + found[0].count - 1).point_m.y(), 0.8, 1e-6);
  }
}

}  // namespace
}  // namespace omnifleet::laser
