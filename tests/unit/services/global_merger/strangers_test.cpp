// A robot that publishes nothing, which one robot sees drive and another only stand.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "global_merger/strangers.h"
#include "merger_scenes.h"

namespace omnifleet::global_merger {
namespace {

constexpr TimeNs kSecond = 1000000000;

/// Seen once a second from a time on at these places.
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

const std::vector<double> kWay{-1.0, -0.8, -0.6, -0.4, -0.2, 0.0, 0.0};

std::vector<ObjectKind> kindsOf(std::vector<Candidate> candidates) {
  tellStrangers(candidates);
  std::vector<ObjectKind> kinds;
  for (const Candidate& candidate : candidates) kinds.push_back(candidate.kind);
  return kinds;
}

TEST(Strangers, OneThatHasStoppedIsNoObstacleToWhoComesLater) {
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, kWay),
                              track("r2", 6, ObjectKind::kObstacle, 14, {0.02, -0.03, 0.01, 0.02, 0.0, 0.01}),
                              track("r2", 7, ObjectKind::kObstacle, 14, {0.3, 0.3, 0.3, 0.3})});
  EXPECT_EQ(kinds, (std::vector{ObjectKind::kRobot, ObjectKind::kRobot, ObjectKind::kObstacle}));
}

TEST(Strangers, WhatStoodThereBeforeOneCameIsWhatItWas) {
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, kWay),
                              track("r2", 6, ObjectKind::kObstacle, 5, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})});
  EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
}

TEST(Strangers, WhatStandsWhereOneHasLeftIsWhatItWas) {
  auto away = kWay;
  away.insert(away.end(), {0.2, 0.4, 0.6, 0.8});
  const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, away),
                              track("r2", 6, ObjectKind::kObstacle, 19, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0})});
  EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
}

/// Who never drove, or whose track went from one thing over to another, is none.
TEST(Strangers, OneWrongVerdictTakesNothingOffTheMap) {
  const Candidate obstacle = track("r2", 6, ObjectKind::kObstacle, 14, {0.0, 0.01, 0.0, 0.01});
  for (const auto& way :
       {std::vector{0.0, 0.02, 0.01, 0.02, 0.0, 0.01}, std::vector{-0.9, -0.9, -0.9, 0.0, 0.0, 0.0}}) {
    const auto kinds = kindsOf({track("r1", 4, ObjectKind::kRobot, 10, way), obstacle});
    EXPECT_EQ(kinds[1], ObjectKind::kObstacle);
  }
  EXPECT_EQ(kindsOf({track("r1", 4, ObjectKind::kObstacle, 10, kWay), obstacle})[1], ObjectKind::kObstacle)
      << "somebody pushes a box";
}

/// r1 sees it drive for two seconds (or not) and stand, r2 sees it stand and takes it for an obstacle.
std::vector<dataset::MapObject> mapWith(bool drives) {
  using omnifleet::testing::SimRobot;
  testing::Sets all;
  for (int i = 0; i < 24; ++i) {
    const double t = 0.25 * i, x_m = drives ? std::min(0.0, -0.8 + 0.1 * i) : 0.0;
    for (const bool first : {true, false}) {
      if (!first && t < 2.5) continue;
      testing::SimThing thing{omnifleet::testing::boxPolygon({x_m, 0.9}, 0.3, 0.3, 0.0), 0.3};
      thing.kind = first && drives ? ObjectKind::kRobot : ObjectKind::kObstacle;
      const Pose2 at = first ? Pose2{-0.5 + 0.05 * t, 0.0, 0.0} : Pose2{0.9 - 0.1 * t, 1.6, 3.0};
      testing::FleetSim sim({thing}, {SimRobot{first ? "r1" : "r2", [at](double) { return at; }}},
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

TEST(Strangers, OneThatHasStoppedIsNotInTheMap) {
  EXPECT_TRUE(mapWith(true).empty());
  EXPECT_EQ(mapWith(false).size(), 1U);
}

}  // namespace
}  // namespace omnifleet::global_merger
