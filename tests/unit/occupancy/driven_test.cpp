// The floor under a robot that maps.

#include <gtest/gtest.h>

#include <cmath>

#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {
namespace {

constexpr std::int32_t kX_dmm = 10000;  // of the obstacle that is reported wrongly

RobotBody box() {
  RobotBody body;
  body.footprint_m = {{-0.1, -0.1}, {0.1, -0.1}, {0.1, 0.1}, {-0.1, 0.1}};
  return body;
}

void addPose(OccupancyMap& map, TimeNs time_ns, std::int32_t x_dmm, std::uint16_t sigma_dmm = 0) {
  KeyframePose pose;
  pose.robot = "r1";
  pose.acquired_ns = time_ns;
  pose.valid = true;
  pose.position = {x_dmm, 0};
  pose.sigma_dmm = sigma_dmm;
  map.add(pose);
}

/// Rays that see nothing, but one along x with the given end.
void addScan(OccupancyMap& map, TimeNs time_ns, RayLabel label, std::int32_t range_dmm) {
  Contribution seen;
  seen.robot = "r1";
  seen.acquired_ns = time_ns;
  seen.range_dmm.assign(360, 0);
  seen.sigma_dmm.assign(360, 0);
  seen.label.assign(360, RayLabel::kInvalid);
  seen.object.assign(360, 0);
  seen.range_dmm[0] = range_dmm;
  seen.label[0] = label;
  map.add(seen);
}

/// A stain is reported as an obstacle at x = 1 m from 0.5 m away, then the robot drives over it.
OccupancyMap driveOver(const OccupancyOptions& options, const RobotBody& body, std::uint16_t sigma_dmm = 0) {
  OccupancyMap map(options, {{"r1", body}});
  addScan(map, 0, RayLabel::kObstacle, 5000);
  addPose(map, 0, 5000);
  for (int k = 1; k <= 5; ++k) {
    const TimeNs time_ns = k * 1'000'000'000LL;
    addScan(map, time_ns, RayLabel::kInvalid, 0);
    addPose(map, time_ns, kX_dmm + 20 * k, sigma_dmm);
  }
  return map;
}

const Eigen::Vector2d kStain(1.001, 0.001);

TEST(DrivenFloor, IsFreeWhateverARayReported) {
  EXPECT_EQ(driveOver({}, box()).at(kStain), CellClass::kFree);
  OccupancyOptions off;
  off.driven_is_free = false;
  EXPECT_EQ(driveOver(off, box()).at(kStain), CellClass::kOccupied);
}

TEST(DrivenFloor, IsVisibleWithoutAnyRay) {
  const OccupancyMap map = driveOver({}, box());
  const structure::SurfaceMap& cells = map.visible();
  const auto u = static_cast<int>((kStain.x() - cells.origin_m.x()) / cells.resolution_m),
             v = static_cast<int>((kStain.y() - cells.origin_m.y()) / cells.resolution_m);
  EXPECT_EQ(cells.cells[static_cast<std::size_t>(v * cells.width + u)], structure::Cell::kFree);
}

TEST(DrivenFloor, ShrinksWithTheSigmaOfThePose) {
  // 3 σ = 0.12 m exceed the body: nothing is known.
  EXPECT_EQ(driveOver({}, box(), 400).at(kStain), CellClass::kOccupied);
}

TEST(DrivenFloor, IsNotClaimedForABodyThatIsNotGiven) {
  EXPECT_EQ(driveOver({}, RobotBody{}).at(kStain), CellClass::kOccupied);
}

TEST(DrivenFloor, CoversWholeCellsOnly) {
  const OccupancyMap map = driveOver({}, box());
  EXPECT_EQ(map.at({1.0, 0.075}), CellClass::kUnknown)
      << "half a diagonal of the cell reaches beyond the side";
  EXPECT_EQ(map.at({1.0, 0.026}), CellClass::kFree);
}

}  // namespace
}  // namespace omnifleet::occupancy
