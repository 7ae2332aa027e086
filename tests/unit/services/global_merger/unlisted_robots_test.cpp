// A robot that publishes nothing: one robot sees it drive, another only at rest.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "global_merger/unlisted_robots.h"
#include "merger_scenes.h"

namespace omnifleet::global_merger {
namespace {

constexpr TimeNs kSecond = 1000000000;

/// A track seen once per second from a time on, at these places.
Candidate track(const std::string& robot, std::uint32_t id, ObjectKind kind, TimeNs from_s,
                const std::vector<double>& x_m) {
  Candidate candidate;
  candidate.robot = robot;
  candidate.track_id = id;
  candidate.kind = kind;
  for (std::size_t i = 0; i < x_m.size(); ++i) {
    ObjectView& view = candidate.views.emplace_back();
    view.robot = robot;
    view.track_id = id;
    view.time_ns = (from_s + static_cast<TimeNs>(i)) * kSecond;
    view.position_m = {x_m[i], 0.5};
  }
  return candidate;
}

const std::vector<double> kPath{-1.0, -0.8, -0.6, -0.4, -0.2, 0.0, 0.0};

std::vector<ObjectKind> kindsOf(std::vector<Candidate> candidates) {
  findUnlistedRobots(candidates);
  std::vector<ObjectKind> kinds;
  for (const Candidate& candidate : candidates) kinds.push_back(candidate.kind);
  return kinds;
}

TEST(UnlistedRobots, MarksTrackAtLastPlaceAsRobot) {
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, kPath),
                              track("r2", 6, ObjectKind::kObstacle, 14, {0.02, -0.03, 0.01, 0.02, 0.0, 0.01}),
                              track("r2", 7, ObjectKind::kObstacle, 14, {0.3, 0.3, 0.3, 0.3})});
  EXPECT_EQ(kinds, (std::vector{ObjectKind::kRobot, ObjectKind::kRobot, ObjectKind::kObstacle}));
}

TEST(UnlistedRobots, KeepsObstacleSeenBeforeTheRobotArrived) {
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, kPath),
                              track("r2", 6, ObjectKind::kObstacle, 5, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})});
  EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
}

TEST(UnlistedRobots, KeepsObstacleSeenAfterTheRobotLeft) {
  auto away = kPath;
  away.insert(away.end(), {0.2, 0.4, 0.6, 0.8});
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, away),
                              track("r2", 6, ObjectKind::kObstacle, 19, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})});
  EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
}

/// A track that never drove, or that switched from one object to another, is not an unlisted robot.
TEST(UnlistedRobots, IgnoresTracksThatDidNotDrive) {
  const Candidate obstacle = track("r2", 6, ObjectKind::kObstacle, 14, {0.0, 0.01, 0.0, 0.01});
  for (const auto& way :
       {std::vector{0.0, 0.02, 0.01, 0.02, 0.0, 0.01}, std::vector{-0.9, -0.9, -0.9, 0.0, 0.0, 0.0}}) {
    const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, way), obstacle});
    EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
  }
  EXPECT_EQ(kindsOf({track("r1", 4, ObjectKind::kObstacle, 10, kPath), obstacle})[1], ObjectKind::kObstacle)
      << "a box that is pushed stays an obstacle";
}

/// r1 sees the object drive for two seconds (or not) and stop. r2 sees it only at rest and classifies it as
/// obstacle.
std::vector<dataset::MapObject> mapWith(bool drives) {
  using omnifleet::testing::SimRobot;
  testing::Sets all;
  for (int i = 0; i < 24; ++i) {
    const double t = 0.25 * i, x_m = drives ? std::min(0.0, -0.8 + 0.1 * i) : 0.0;
    for (const bool first : {true, false}) {
      if (!first && t < 2.5) continue;
      testing::SimObstacle obstacle{omnifleet::testing::boxPolygon({x_m, 0.9}, 0.3, 0.3, 0.0), 0.3};
      obstacle.kind = first && drives ? ObjectKind::kRobot : ObjectKind::kObstacle;
      const Pose2 at = first ? Pose2{-0.5 + 0.05 * t, 0.0, 0.0} : Pose2{0.9 - 0.1 * t, 1.6, 3.0};
      testing::FleetSim sim({obstacle}, {SimRobot{first ? "r1" : "r2", [at](double) { return at; }}},
                            testing::noisy(), 1000U + static_cast<unsigned>(i));
      const testing::Sets sets = testing::record(sim, t, t + 0.01);
      all.contributions.insert(all.contributions.end(), sets.contributions.begin(), sets.contributions.end());
      all.poses.insert(all.poses.end(), sets.poses.begin(), sets.poses.end());
    }
  }
  Merger merger = testing::merged(all, {});
  merger.finish();
  return merger.outlines();
}

TEST(UnlistedRobots, LeavesStoppedRobotOutOfTheMap) {
  EXPECT_TRUE(mapWith(true).empty());
  EXPECT_EQ(mapWith(false).size(), 1U);
}

}  // namespace
}  // namespace omnifleet::global_merger
