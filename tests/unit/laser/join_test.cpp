#include "laser/join.h"

#include <gtest/gtest.h>

#include <cmath>

#include "laser/laser_mapper.h"
#include "tests/unit/laser/room.h"

namespace omnifleet::laser {
namespace {

/// A wall 3 m ahead, a disc to the left at 1 m; the scanner stands where `origin` says, the room is about it.
LocalMap scanned(const Eigen::Vector2d& origin_m) {
  test::Room room;
  room.polygons = {{{3.0, -2.0}, {3.2, -2.0}, {3.2, 2.0}, {3.0, 2.0}}};
  room.discs.push_back({{0.0, 1.0}, 0.2});
  dataset::LaserSensor sensor;
  sensor.position_m = {origin_m.x(), origin_m.y(), 0.1};
  sensor.range_max_m = 5.0;
  return LaserMapper(sensor, {}).process(room.scan(1440), 0, {});
}

/// What a camera sees of it: floor up to 2 m all around, with an object between `from` and `to`.
Scan seen(std::size_t from, std::size_t to, float range_m) {
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

TEST(Join, EchoesTakeThePlaceOfRaysAndObjectsStayTheCameras) {
  Scan scan = seen(80, 101, 0.85f);
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.label[0], RayLabel::kObstacle) << "the wall beyond the camera's floor";
  EXPECT_NEAR(scan.range_m[0], 3.0, 1e-3);
  EXPECT_EQ(scan.object[0], 0);
  EXPECT_EQ(scan.object[90], 3) << "the camera saw it 5 cm off";
  EXPECT_NEAR(scan.range_m[90], 0.8, 1e-3);
  EXPECT_LT(scan.sigma_m[90], 0.011f);
  EXPECT_EQ(scan.label[180], RayLabel::kFloorEnd) << "no echo: as the camera saw it";
  EXPECT_EQ(scan.range_m[180], 2.0f);
}

/// A low thing before the wall: the laser passes over it, the camera does not.
TEST(Join, WhatIsLowerThanTheLaserStaysTheCameras) {
  Scan scan = seen(0, 5, 1.0f);
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.range_m[2], 1.0f);
  EXPECT_EQ(scan.object[2], 3);
}

/// What the camera took for floor and the laser hits stands there, of unknown kind.
TEST(Join, WhatTheCameraMissedIsThere) {
  Scan scan = seen(0, 0, 0.0f);
  scan.label[90] = RayLabel::kUndecided;  // or left open
  join(scanned({0, 0}), scan);
  EXPECT_EQ(scan.label[90], RayLabel::kUnknown);
  EXPECT_EQ(scan.object[90], 0);
  EXPECT_NEAR(scan.range_m[90], 0.8, 1e-3);
}

/// The scanner stands half a metre before the camera: ranges are counted from the camera's foot.
TEST(Join, RangesAreFromTheCamerasFoot) {
  Scan scan = seen(0, 0, 0.0f);
  join(scanned({0.5, 0.0}), scan);
  EXPECT_NEAR(scan.range_m[0], 3.5, 1e-3);
  const std::size_t disc = 63;  // atan2(1, 0.5) = 63.4°
  EXPECT_NEAR(scan.range_m[disc], std::hypot(1.0, 0.5) - 0.2, 5e-3);
}

TEST(Join, AnInvalidScanChangesNothing) {
  LocalMap bad = scanned({0, 0});
  bad.state = FrameState::kNonFinite;
  Scan scan = seen(80, 101, 0.85f);
  const Scan before = scan;
  join(bad, scan);
  EXPECT_EQ(scan.range_m, before.range_m);
  EXPECT_EQ(scan.label, before.label);
}

}  // namespace
}  // namespace omnifleet::laser
