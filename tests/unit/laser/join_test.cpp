#include "laser/join.h"

#include <gtest/gtest.h>

#include <cmath>

#include "laser/laser_mapper.h"
#include "tests/unit/laser/room.h"

namespace omnifleet::laser {
namespace {

/// A wall 3 m ahead and a disc 1 m to the left, relative to the scanner. `origin_m`: the scanner in
/// base_link.
LocalMap scanned(const Eigen::Vector2d& origin_m) {
  test::Room room;
  room.polygons = {{{3.0, -2.0}, {3.2, -2.0}, {3.2, 2.0}, {3.0, 2.0}}};
  room.discs.push_back({{0.0, 1.0}, 0.2});
  dataset::LaserSensor sensor;
  sensor.position_m = {origin_m.x(), origin_m.y(), 0.1};
  sensor.range_max_m = 5.0;
  return LaserMapper(sensor, {}).process(room.scan(1440), 0, {});
}

/// Scan of a camera: floor up to 2 m in all directions, with an object between rays `from` and `to`.
Scan cameraScan(std::size_t from, std::size_t to, float range_m) {
  Scan scan;
  scan.range_m.assign(360, 2.0f);
  scan.sigma_m.assign(360, 0.02f);
  scan.label.assign(360, RayLabel::kFloorEnd);
  scan.object.assign(360, 0);
  for (std::size_t i = from; i < to; ++i) {
    scan.range_m[i] = range_m;
    scan.label[i] = RayLabel::kUnknown;
    scan.object[i] = 3;
  }
  return scan;
}

TEST(Join, ReplacesRangesAndKeepsCameraObjects) {
  Scan scan = cameraScan(80, 101, 0.85f);
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.label[0], RayLabel::kObstacle) << "the wall behind the floor seen by the camera";
  EXPECT_NEAR(scan.range_m[0], 3.0, 1e-3);
  EXPECT_EQ(scan.object[0], 0);
  EXPECT_EQ(scan.object[90], 3) << "the camera saw the object at 5 cm distance";
  EXPECT_NEAR(scan.range_m[90], 0.8, 1e-3);
  EXPECT_LT(scan.sigma_m[90], 0.011f);
  EXPECT_EQ(scan.label[180], RayLabel::kFloorEnd) << "no echo: the camera's ray is kept";
  EXPECT_EQ(scan.range_m[180], 2.0f);
}

/// A low object in front of the wall: the laser passes over it, the camera sees it.
TEST(Join, KeepsObjectBelowTheLaserPlane) {
  Scan scan = cameraScan(0, 5, 1.0f);
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.range_m[2], 1.0f);
  EXPECT_EQ(scan.object[2], 3);
}

/// An echo on what the camera classified as floor is an object of unknown kind.
TEST(Join, AddsObjectThatTheCameraMissed) {
  Scan scan = cameraScan(0, 0, 0.0f);
  scan.label[90] = RayLabel::kUndecided;  // undecided rays too
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.label[90], RayLabel::kUnknown);
  EXPECT_EQ(scan.object[90], 0);
  EXPECT_NEAR(scan.range_m[90], 0.8, 1e-3);
}

/// The scanner is 0.5 m in front of the camera. Ranges are measured from the camera's foot.
TEST(Join, MeasuresRangesFromTheCameraFoot) {
  Scan scan = cameraScan(0, 0, 0.0f);
  join(scanned({0.5, 0.0}), scan);
  EXPECT_NEAR(scan.range_m[0], 3.5, 1e-3);
  const std::size_t disc = 63;  // atan2(1, 0.5) = 63.4°
  EXPECT_NEAR(scan.range_m[disc], std::hypot(1.0, 0.5) - 0.2, 5e-3);
}

TEST(Join, IgnoresInvalidScan) {
  LocalMap bad = scanned({0, 0});
  bad.state = FrameState::kNonFinite;
  Scan scan = cameraScan(80, 101, 0.85f);
  const Scan before = scan;
  join(bad, scan);
  EXPECT_EQ(scan.range_m, before.range_m);
  EXPECT_EQ(scan.label, before.label);
}

}  // namespace
}  // namespace omnifleet::laser
