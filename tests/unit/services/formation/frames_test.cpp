// Poses in a robot's own frame do not enter what the formation knows in map: its view of the fleet, and the
// exploration grid that the robots share.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "formation/fleet_view.h"
#include "formation/shared_grid.h"

namespace omnifleet::formation {
namespace {

constexpr TimeNs kSecond_ns = 1'000'000'000;
constexpr double kAgeLimit_s = 2.0;

/// @param frame empty: map
PoseEstimate poseIn(const std::string& frame, const std::string& robot, TimeNs time_ns,
                    const Pose2& frame_from_base) {
  PoseEstimate estimate;
  estimate.robot = robot;
  estimate.acquired_ns = time_ns;
  estimate.valid = true;
  estimate.frame = frame;
  estimate.map_from_base = frame_from_base;
  return estimate;
}

TEST(FleetView, IgnoresPosesInAnotherFrame) {
  FleetView view("r1", kAgeLimit_s, true);
  PoseEstimate own = poseIn("r1", "r1", kSecond_ns, {0.5, 0.0, 0.0});
  own.sightings = {{7, "r2"}};
  view.learn(
      {own, poseIn("r2", "r2", kSecond_ns, {1.0, 0.0, 0.0}), poseIn("", "r3", kSecond_ns, {2.0, 0.0, 0.0})});
  EXPECT_FALSE(view.now("r1", kSecond_ns)) << "the own place in map is unknown";
  EXPECT_FALSE(view.now("r2", kSecond_ns));
  EXPECT_TRUE(view.ownSightings().empty());
  ASSERT_TRUE(view.now("r3", kSecond_ns));
  // Once in map, a robot is where its poses in map are. The step from the other frame is no motion.
  view.learn({poseIn("", "r2", 2 * kSecond_ns, {-3.0, 4.0, 1.0})});
  const auto matched = view.now("r2", 2 * kSecond_ns + kSecond_ns / 2);
  ASSERT_TRUE(matched);
  EXPECT_EQ(matched->vector(), Eigen::Vector3d(-3.0, 4.0, 1.0));
  EXPECT_EQ(view.twist("r2").forward_mps, 0.0);
}

/// Floor up to 1 m all around, and nothing solid.
motion::FormationState bareFloor(const std::string& robot, TimeNs time_ns) {
  motion::FormationState state;
  state.robot = robot;
  state.acquired_ns = time_ns;
  state.view.step_rad = static_cast<float>(2.0 * M_PI / motion::View::kMostRays);
  state.view.ray.assign(motion::View::kMostRays, motion::View::entry(motion::View::kFree, 1.0));
  return state;
}

/// Area of the free cells of a grid, m².
double freeArea(const motion::ExplorationGrid& grid) {
  int cells = 0;
  for (const std::uint8_t cell : grid.cells())
    cells += cell == static_cast<std::uint8_t>(motion::Cell::kFree);
  return cells * grid.cell_m() * grid.cell_m();
}

TEST(SharedGrid, IgnoresPosesInAnotherFrame) {
  RobotBody body;
  body.radius_m = 0.15;
  SharedGrid shared({}, {{"r1", body}, {"r2", body}});
  shared.learn({poseIn("r2", "r2", kSecond_ns, {1.0, 0.5, 0.0})}, {bareFloor("r2", kSecond_ns)});
  EXPECT_FALSE(shared.pose("r2"));
  EXPECT_EQ(freeArea(shared.grid()), 0.0) << "neither its body nor its view has a place in map";
  EXPECT_TRUE(shared.stated().empty());
  // The same view at a pose in map, which its own frame has put elsewhere.
  shared.learn({poseIn("", "r2", 2 * kSecond_ns, {-1.0, -0.5, 0.3})}, {bareFloor("r2", 2 * kSecond_ns)});
  EXPECT_NEAR(freeArea(shared.grid()), M_PI, 0.2) << "a disc of 1 m; half a cell along its rim is 0.13 m²";
  EXPECT_EQ(shared.grid().at(shared.grid().cellOf({-1.0, -0.5})), motion::Cell::kFree);
  EXPECT_EQ(shared.grid().at(shared.grid().cellOf({1.0, 0.5})), motion::Cell::kUnknown);
}

}  // namespace
}  // namespace omnifleet::formation
