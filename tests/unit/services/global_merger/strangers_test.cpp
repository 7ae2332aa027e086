// A robot that publishes nothing, which one robot sees drive and another only stand.

#include <gtest/gtest.h>

#include "global_merger/strangers.h"

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

}  // namespace
}  // namespace omnifleet::global_merger
