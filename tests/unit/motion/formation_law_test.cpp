#include "motion/formation_law.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::motion {
namespace {

FormationCommand commandFor(FormationShape shape) {
  FormationCommand command;
  command.shape = shape;
  command.distance_m = 1.0;
  command.angle_rad = 0.6;
  return command;
}

TEST(FormationShapes, ComputesPlacesOfColumnLineAndWedge) {
  const auto column = placesOf(commandFor(FormationShape::kColumn), 4);
  for (int i = 0; i < 4; ++i) EXPECT_LT((column[i] - Eigen::Vector2d(-i, 0)).norm(), 1e-12);

  const auto line = placesOf(commandFor(FormationShape::kLine), 5);
  const double sides[] = {0, 1, -1, 2, -2};
  for (int i = 0; i < 5; ++i) EXPECT_LT((line[i] - Eigen::Vector2d(0, sides[i])).norm(), 1e-12);

  const auto wedge = placesOf(commandFor(FormationShape::kWedge), 5);
  EXPECT_LT((wedge[1] - Eigen::Vector2d(-std::cos(0.6), std::sin(0.6))).norm(), 1e-12);
  EXPECT_LT((wedge[2] - Eigen::Vector2d(-std::cos(0.6), -std::sin(0.6))).norm(), 1e-12);
  EXPECT_LT((wedge[3] - 2 * wedge[1]).norm(), 1e-12);
  EXPECT_LT((wedge[4] - 2 * wedge[2]).norm(), 1e-12);
}

TEST(FormationShapes, BuildsEquilateralTriangle) {
  const auto places = placesOf(commandFor(FormationShape::kTriangle), 6);
  // Rows of one, two, three; neighbours in a row and between rows at distance d.
  const std::pair<int, int> neighbours[] = {{0, 1}, {0, 2}, {1, 2}, {1, 3}, {1, 4},
                                            {2, 4}, {2, 5}, {3, 4}, {4, 5}};
  for (const auto& [a, b] : neighbours) EXPECT_NEAR((places[a] - places[b]).norm(), 1.0, 1e-12) << a << b;
  EXPECT_GT(places[1].y(), 0.0);
  EXPECT_NEAR(places[4].y(), 0.0, 1e-12);
}

TEST(FollowLaw, MatchesFollowedVelocityWhenInPlace) {
  const FollowLaw law({});
  const Slot slot{0, 0.8, 0.5};
  const Followed followed{0.8 * Eigen::Vector2d(std::cos(0.5), std::sin(0.5)), 0.0, {0.25, 0.0}, true};
  const auto result = law.wanted(slot, followed);
  EXPECT_LT(result.place_m.norm(), 1e-12);
  EXPECT_LT((result.velocity_mps - Eigen::Vector2d(0.25, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(result.distance_error_m, 0.0, 1e-12);
  EXPECT_NEAR(result.angle_error_rad, 0.0, 1e-12);
}

TEST(FollowLaw, FeedsForwardRotationOfTheFollowedRobot) {
  FollowLaw::Options options;
  options.swing_max_mps = 10.0;
  options.patient_m = 0.0;
  const FollowLaw law(options);
  // Abreast on the left of a robot that turns left about its own centre: the place moves backwards by ω·d.
  const Followed followed{{0.0, -0.8}, 0.0, {0.0, 0.5}, true};
  const auto result = law.wanted({0, 0.8, -0.5 * M_PI}, followed);
  EXPECT_LT(result.place_m.norm(), 1e-12);
  EXPECT_LT((result.velocity_mps - Eigen::Vector2d(-0.4, 0.0)).norm(), 1e-9);
}

TEST(FollowLaw, ReportsDistanceAndAngleErrorsOfThePaper) {
  const auto result = FollowLaw({}).wanted({0, 0.8, 0.5}, {{0.0, 1.0}, 0.0, {}, true});
  EXPECT_NEAR(result.distance_error_m, 0.2, 1e-12);
  EXPECT_NEAR(result.angle_error_rad, 0.5 * M_PI - 0.5, 1e-12);
}

TEST(FollowLaw, StopsNearPlaceWhenFollowedRobotStands) {
  const Followed standing{{0.82, 0.0}, 0.0, {0.0, 0.0}, true};
  EXPECT_TRUE(FollowLaw({}).wanted({0, 0.8, 0.0}, standing).velocity_mps.isZero());
}

TEST(LeadLaw, VisitsWaypointsInOrderThenStops) {
  LeadLaw law({});
  law.follow({{1.0, 0.0}, {1.0, 1.0}});
  EXPECT_LT((law.wanted({0, 0, 0}, 0.0, 0.25) - Eigen::Vector2d(0.25, 0.0)).norm(), 1e-12);
  // In base_link: heading north at the origin, the waypoint lies to the right.
  EXPECT_LT((law.wanted({0, 0, 0.5 * M_PI}, 0.0, 0.25) - Eigen::Vector2d(0.0, -0.25)).norm(), 1e-12);
  EXPECT_NEAR(law.remainingDistance({0.5, 0.0}), 1.5, 1e-12);
  EXPECT_GT(law.wanted({0.9, 0, 0}, 0.0, 0.25).y(), 0.2);  // first waypoint passed: on to the goal
  EXPECT_NEAR(law.remainingDistance({1.0, 0.2}), 0.8, 1e-12);
  EXPECT_LT(law.wanted({1.0, 0.8, 0}, 0.0, 0.25).norm(), 0.11);  // near the goal: slower
  EXPECT_FALSE(law.arrived());
  EXPECT_TRUE(law.wanted({1.0, 0.97, 0}, 0.0, 0.25).isZero());
  EXPECT_TRUE(law.arrived());
  EXPECT_EQ(law.remainingDistance({3.0, 3.0}), 0.0);
}

TEST(LeadLaw, WaitsForFollowersOutOfPlace) {
  const LeadLaw::Options options;
  LeadLaw law(options);
  law.follow({{5.0, 0.0}});
  EXPECT_NEAR(law.wanted({}, options.wait_from_m, 0.2).norm(), 0.2, 1e-12);
  EXPECT_NEAR(law.wanted({}, options.wait_full_m, 0.2).norm(), 0.2 * options.wait_speed, 1e-12);
  EXPECT_NEAR(law.wanted({}, 9.0, 0.2).norm(), 0.2 * options.wait_speed, 1e-12);
}

TEST(TwistTowards, ReachesDesiredVelocityWithinLimits) {
  const DriveLimits limits;
  Twist twist;
  for (int i = 0; i < 10; ++i) {
    const Twist next = twistTowards({0.25, 0.0}, 0.0, twist, 0.2, limits.max_turn_radps, limits);
    EXPECT_LE(std::abs(next.forward_mps - twist.forward_mps), limits.max_mps2 * 0.2 + 1e-12);
    twist = next;
  }
  EXPECT_NEAR(twist.forward_mps, 0.25, 1e-12);
  for (int i = 0; i < 5; ++i) twist = twistTowards(Eigen::Vector2d::Zero(), 0.0, twist, 0.2, 1.0, limits);
  EXPECT_EQ(twist.forward_mps, 0.0);
  EXPECT_EQ(twist.turn_radps, 0.0);
}

TEST(TwistTowards, TurnsBeforeDrivingAndReversesOnlySlowly) {
  const DriveLimits limits;
  const Twist aside = twistTowards({0.0, 0.25}, 0.0, {}, 1.0, limits.max_turn_radps, limits);
  EXPECT_NEAR(aside.forward_mps, 0.0, 1e-12);
  EXPECT_GT(aside.turn_radps, 1.0);
  const Twist back = twistTowards({-0.04, 0.0}, 0.0, {}, 1.0, limits.max_turn_radps, limits);
  EXPECT_NEAR(back.forward_mps, -0.04, 1e-12);
  EXPECT_NEAR(back.turn_radps, 0.0, 1e-9);
  EXPECT_NEAR(twistTowards({-0.25, 0.01}, 0.0, {}, 1.0, limits.max_turn_radps, limits).forward_mps, 0.0,
              1e-12);
}

TEST(DriveLimits, RejectsInvalidOptions) {
  EXPECT_THROW(DriveLimits::read(options::Section::parse("cruise_mps: 0.5", "test")), options::Error);
  EXPECT_THROW(DriveLimits::read(options::Section::parse("max_mps: fast", "test")), options::Error);
}

}  // namespace
}  // namespace omnifleet::motion
