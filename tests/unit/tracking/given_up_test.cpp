// Who is taken for whom again.

#include "tracking/given_up.h"

#include <gtest/gtest.h>

namespace omnifleet::tracking {
namespace {

constexpr double kGate_m = 0.25, kKeep_s = 15.0;

PrismFilter body(const Eigen::Vector2d& place_m, double radius_m) {
  PrismFilter filter({}, place_m, 0.5);
  filter.assumeBody(radius_m, 0.3, true);
  return filter;
}

TimeNs after(double time_s) {
  return static_cast<TimeNs>(1e9 * time_s);
}

/// Last seen at the origin, at time zero.
class GivenUpTest : public testing::Test {
 protected:
  GivenUp giveUp(std::uint32_t id, double speed_mps) const {
    TrackState track(id, body(Eigen::Vector2d::Zero(), 0.15));
    track.kind = ObjectKind::kRobot;
    track.last_speed_mps = speed_mps;
    GivenUp given_up;
    given_up.add(track);
    return given_up;
  }
};

TEST_F(GivenUpTest, WhatStoodIsFoundInItsPlaceAlone) {
  GivenUp given_up = giveUp(7, 0.0);
  EXPECT_FALSE(given_up.take(body({0.4, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s));
  const auto found = given_up.take(body({0.1, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->id, 7U);
  EXPECT_EQ(found->kind, ObjectKind::kRobot);
  EXPECT_FALSE(given_up.take(body({0.1, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s)) << "nobody is two";
}

TEST_F(GivenUpTest, WhatDroveIsFoundOnItsWayByItsShape) {
  EXPECT_TRUE(giveUp(7, 0.2).take(body({1.5, 0.0}, 0.15), kGate_m, after(7.0), kKeep_s));
  EXPECT_FALSE(giveUp(7, 0.2).take(body({1.5, 0.0}, 0.10), kGate_m, after(7.0), kKeep_s)) << "another";
  EXPECT_FALSE(giveUp(7, 0.2).take(body({1.5, 0.0}, 0.15), kGate_m, after(2.0), kKeep_s)) << "too far";
}

TEST_F(GivenUpTest, AnObstacleStaysForAMinute) {
  TrackState track(7, body(Eigen::Vector2d::Zero(), 0.15));
  track.kind = ObjectKind::kObstacle;
  for (const double time_s : {59.0, 61.0}) {
    GivenUp given_up;
    given_up.add(track);
    EXPECT_EQ(given_up.take(body({0.1, 0.0}, 0.15), kGate_m, after(time_s), kKeep_s).has_value(),
              time_s < 60.0);
  }
}

TEST_F(GivenUpTest, WhoPublishesIsNotGivenUp) {
  TrackState track(7, body(Eigen::Vector2d::Zero(), 0.15));
  track.identity = 0;
  GivenUp given_up;
  given_up.add(track);
  EXPECT_FALSE(given_up.take(body({0.1, 0.0}, 0.15), kGate_m, after(1.0), kKeep_s));
}

TEST_F(GivenUpTest, NobodyIsRememberedForEver) {
  EXPECT_TRUE(giveUp(7, 0.0).take(body({0.1, 0.0}, 0.15), kGate_m, after(14.0), kKeep_s));
  EXPECT_FALSE(giveUp(7, 0.0).take(body({0.1, 0.0}, 0.15), kGate_m, after(16.0), kKeep_s));
  GivenUp given_up = giveUp(7, 0.0);
  given_up.forget();
  EXPECT_FALSE(given_up.take(body({0.1, 0.0}, 0.15), kGate_m, after(1.0), kKeep_s));
}

}  // namespace
}  // namespace omnifleet::tracking
