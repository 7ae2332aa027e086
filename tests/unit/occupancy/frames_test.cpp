// Maps of fleets in which a robot's poses are in a frame of its own (KeyframePose::frame).

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "fleet_sim.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/robot_paths.h"

namespace omnifleet::occupancy {
namespace {

using omnifleet::testing::boxPolygon;
using omnifleet::testing::FleetSim;

constexpr TimeNs kFrameStep_ns = 250'000'000;
/// How the frame of r2 lies: its origin is where r2 begins, so its poses in that frame lie among those of r1.
const Pose2 kOwnFromMap = Pose2{1.0, -0.9, 1.5}.inverse();

/// Samples of r1, whose poses are in the common frame, and of r2.
struct TwoFrames {
  std::vector<Contribution> contributions;
  std::vector<KeyframePose> r1, r2_own,
      r2_again;  ///< r2: in its own frame; published again in the common one

  TwoFrames() {
    FleetSim sim = fleet();
    for (int step = 0; step < 28; ++step) {
      for (auto& seen : sim.at(1e-9 * kFrameStep_ns * step)) {
        contributions.push_back(makeContribution(seen.objects));
        if (seen.pose.robot == "r1") {
          r1.push_back(makeKeyframePose(seen.pose));
          continue;
        }
        r2_again.push_back(makeKeyframePose(seen.pose, 1, 4));
        seen.pose.frame = "r2";
        seen.pose.map_from_base = kOwnFromMap * seen.pose.map_from_base;
        r2_own.push_back(makeKeyframePose(seen.pose));
      }
    }
  }
  static FleetSim fleet() {
    return FleetSim(
        {{boxPolygon({0.0, -0.9}, 0.4, 0.3, 0.3), 0.2}, {boxPolygon({1.6, 0.9}, 0.3, 0.3, 0.0), 0.2}},
        {{"r1",
          [](double t) {
            return Pose2{-0.9 + 0.2 * t, 0.0, 0.1 * t};
          }},
         {"r2",
          [](double t) {
            return Pose2{1.0, -0.9 + 0.15 * t, 1.5};
          }}},
        {});
  }
  std::vector<Contribution> of(const std::string& robot) const {
    std::vector<Contribution> some;
    std::copy_if(contributions.begin(), contributions.end(), std::back_inserter(some),
                 [&](const Contribution& c) { return c.robot == robot; });
    return some;
  }
};

OccupancyMap mapIn(const std::string& frame, const std::vector<Contribution>& contributions,
                   const std::vector<std::vector<KeyframePose>>& poses) {
  OccupancyMap map({}, TwoFrames::fleet().bodies(), frame);
  for (const auto& c : contributions) map.add(c);
  for (const auto& some : poses)
    for (const auto& p : some) map.add(p);
  return map;
}

void expectSameMap(const OccupancyMap& a, const OccupancyMap& b) {
  EXPECT_EQ(hexText(a.hash()), hexText(b.hash()));
  EXPECT_EQ(a.grid().cells, b.grid().cells);
  EXPECT_EQ(a.octreeBytes(), b.octreeBytes());
}

TEST(MapFrame, NothingOfRobotInItsOwnFrameEntersTheCommonMap) {
  const TwoFrames fleet;
  const OccupancyMap map = mapIn("", fleet.contributions, {fleet.r1, fleet.r2_own});
  const OccupancyMap without = mapIn("", fleet.of("r1"), {fleet.r1});
  EXPECT_GT(without.grid().width, 40);
  expectSameMap(map, without);  // neither its cells, nor its footprint over what r1 sees
  EXPECT_EQ(map.store().poses(), fleet.r1.size() + fleet.r2_own.size()) << "the sets hold all samples";
  EXPECT_EQ(map.store().contributions(), fleet.contributions.size());
}

/// The fleet of the test above would hide a footprint that is placed by numbers of another frame.
TEST(MapFrame, FootprintInTheWrongFrameWouldHideCells) {
  const TwoFrames fleet;
  std::vector<KeyframePose> mistaken = fleet.r2_own;
  for (KeyframePose& pose : mistaken) pose.frame.clear();
  const OccupancyMap map = mapIn("", fleet.of("r1"), {fleet.r1, mistaken});
  EXPECT_NE(hexText(map.hash()), hexText(mapIn("", fleet.of("r1"), {fleet.r1}).hash()));
}

TEST(MapFrame, EverythingEntersTheCommonMapWhenPosesArePublishedAgain) {
  const TwoFrames fleet;
  const OccupancyMap at_once = mapIn("", fleet.contributions, {fleet.r1, fleet.r2_again});
  expectSameMap(mapIn("", fleet.contributions, {fleet.r1, fleet.r2_own, fleet.r2_again}), at_once);
  expectSameMap(mapIn("", fleet.contributions, {fleet.r2_again, fleet.r1, fleet.r2_own}), at_once);
}

TEST(MapFrame, CommonMapIsIndependentOfOrder) {
  const TwoFrames fleet;
  const OccupancyMap reference = mapIn("", fleet.contributions, {fleet.r1, fleet.r2_again});
  std::vector<KeyframePose> poses = fleet.r1;
  for (const auto* some : {&fleet.r2_own, &fleet.r2_again})
    poses.insert(poses.end(), some->begin(), some->end());
  std::vector<Contribution> contributions = fleet.contributions;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    std::mt19937 random(seed);
    std::shuffle(poses.begin(), poses.end(), random);
    std::shuffle(contributions.begin(), contributions.end(), random);
    OccupancyMap map({}, TwoFrames::fleet().bodies());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      map.add(poses[i]);
      if (i < contributions.size()) map.add(contributions[i]);
    }
    expectSameMap(map, reference);
  }
}

TEST(MapFrame, OwnMapEqualsTheMapOfTheRobotAlone) {
  const TwoFrames fleet;
  std::vector<KeyframePose> alone = fleet.r2_own;
  for (KeyframePose& pose : alone) pose.frame.clear();
  expectSameMap(mapIn("r2", fleet.contributions, {fleet.r1, fleet.r2_own}),
                mapIn("", fleet.of("r2"), {alone}));
}

TEST(MapFrame, OwnMapIsEmptyWhenPosesArePublishedAgain) {
  const TwoFrames fleet;
  const OccupancyMap map = mapIn("r2", fleet.of("r2"), {fleet.r2_own, fleet.r2_again});
  EXPECT_EQ(map.grid().width, 0);
  expectSameMap(map, mapIn("r2", {}, {}));
}

KeyframePose poseAt(TimeNs time_s, std::int32_t x_dmm, const std::string& frame) {
  KeyframePose pose;
  pose.robot = "r2";
  pose.acquired_ns = time_s * 1'000'000'000;
  pose.valid = true;
  pose.frame = frame;
  pose.position = {x_dmm, 0};
  return pose;
}

TEST(MapFrame, PathLeavesOutPosesInAnotherFrame) {
  ContributionStore store;
  for (const auto& pose : {poseAt(0, 0, ""), poseAt(1, 99999, "r2"), poseAt(2, 1000, ""), poseAt(9, 7, "r2")})
    store.add(pose);
  const RobotPaths paths(store, 1'000'000'000, 5'000'000'000);
  ASSERT_TRUE(paths.at("r2", 1'000'000'000));
  EXPECT_EQ(paths.at("r2", 1'000'000'000)->position.x_dmm, 500) << "between the poses in this frame";
  EXPECT_FALSE(paths.at("r2", 9'000'000'000)) << "a robot whose pose is in another frame has no place here";
}

TEST(MapFrame, CameraErrorComesFromPosesInTheMap) {
  ContributionStore store;
  KeyframePose in_map = poseAt(0, 0, ""), apart = poseAt(1, 0, "r2");
  in_map.camera_error = {1000, 0, 0, 0};
  apart.camera_error = {5000, 0, 0, 0};
  store.add(in_map);
  store.add(apart);
  EXPECT_EQ(store.cameraError("r2"), in_map.camera_error);
}

}  // namespace
}  // namespace omnifleet::occupancy
