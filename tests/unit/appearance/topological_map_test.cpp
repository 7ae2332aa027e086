#include "appearance/topological_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "appearance/keyframe_policy.h"
#include "tests/unit/appearance/small_map.h"

namespace omnifleet::appearance {
namespace {

using test::smallFormat;
using test::smallSignature;

Transition turnAndDifference(double turn_rad, double difference) {
  Transition t;
  t.turn_rad = turn_rad;
  t.turn_sigma_rad = 0.01;
  t.difference = difference;
  return t;
}

TEST(TopologicalMap, FollowsEquations3To5WithAccumulatedHeading) {
  TopologicalMapOptions literal;
  literal.midway = false;
  TopologicalMap map("r1", "r1", smallFormat(), literal);
  map.add(0, 0, smallSignature(0), std::nullopt);
  double x = 0.0, y = 0.0, heading = 0.0;
  for (unsigned i = 1; i <= 20; ++i) {
    const double turn = 0.1 * std::sin(i), d = 0.2 + 0.05 * std::cos(i);
    map.add(i, i, smallSignature(i), turnAndDifference(turn, d));
    heading += turn;
    x += d * std::cos(heading);
    y += d * std::sin(heading);
    const Pose2& pose = map.places().back().frame_from_base;
    EXPECT_NEAR(pose.x_m, x, 1e-12);
    EXPECT_NEAR(pose.y_m, y, 1e-12);
    EXPECT_NEAR(pose.theta_rad, wrapAngle(heading), 1e-12);
  }
  EXPECT_FALSE(map.scale().metric);
  EXPECT_FALSE(map.places().back().metric);
}

TEST(TopologicalMap, FollowsCircleExactlyWithDirectionMidway) {
  TopologicalMap map("r1", "r1", smallFormat());
  map.add(0, 0, smallSignature(0), std::nullopt);
  const int count = 24;
  const double turn = 2.0 * M_PI / count, radius = 2.0, chord = 2.0 * radius * std::sin(0.5 * turn);
  for (unsigned i = 1; i <= count; ++i) map.add(i, i, smallSignature(i), turnAndDifference(turn, chord));
  EXPECT_LT(map.places().back().frame_from_base.translation().norm(), 1e-9);
  // Half of the way the robot is at the other side.
  EXPECT_NEAR(map.places()[count / 2].frame_from_base.y_m, 2.0 * radius, 1e-9);
}

TEST(TopologicalMap, TakesDirectionOfDisplacement) {
  // The robot drives 1 m ahead, then turns by 90° on the spot: the displacement has the old heading.
  TopologicalMap map("r1", "r1", smallFormat());
  map.add(0, 0, smallSignature(0), std::nullopt);
  Transition t = turnAndDifference(M_PI / 2.0, 1.0);
  t.displacement_m = 1.0;
  t.bearing_rad = -M_PI / 4.0;
  map.add(1, 1, smallSignature(1), t);
  EXPECT_NEAR(map.places()[1].frame_from_base.x_m, 1.0, 1e-12);
  EXPECT_NEAR(map.places()[1].frame_from_base.y_m, 0.0, 1e-12);
}

TEST(TopologicalMap, LearnsScaleFromWheelsAndReportsIt) {
  TopologicalMapOptions options;
  options.use_wheels = false;  // lengths from D alone
  TopologicalMap map("r1", "r1", smallFormat(), options);
  map.add(0, 0, smallSignature(0), std::nullopt);
  map.add(1, 1, smallSignature(1), turnAndDifference(0.0, 0.3));
  EXPECT_FALSE(map.places()[1].metric);
  EXPECT_DOUBLE_EQ(map.places()[1].frame_from_base.x_m, 0.3);
  // D of 0.3 and 0.4, wheels 0.1 m and 0.12 m: scale = Σ D·length / Σ D² = 0.078 / 0.25.
  Transition t = turnAndDifference(0.0, 0.3);
  t.displacement_m = 0.1;
  map.add(2, 2, smallSignature(2), t);
  t.difference = 0.4;
  t.displacement_m = -0.12;  // backwards: D has no sign
  map.add(3, 3, smallSignature(3), t);
  EXPECT_TRUE(map.scale().metric);
  EXPECT_NEAR(map.scale().metres, 0.312, 1e-12);
  const double residuals = std::pow(0.1 - 0.312 * 0.3, 2) + std::pow(0.12 - 0.312 * 0.4, 2);
  EXPECT_NEAR(map.scale().sigma_metres, std::sqrt(residuals / 1.0 / 0.25), 1e-9);
  // The place before any wheels is laid out anew.
  EXPECT_TRUE(map.places()[1].metric);
  EXPECT_NEAR(map.places()[1].frame_from_base.x_m, 0.312 * 0.3, 1e-12);
}

TEST(TopologicalMap, TakesLengthOfWheelsWhereThereAreAny) {
  TopologicalMap map("r1", "r1", smallFormat());
  map.add(0, 0, smallSignature(0), std::nullopt);
  Transition t = turnAndDifference(0.0, 0.3);
  t.displacement_m = -0.1;
  t.displacement_sigma_m = 0.004;
  map.add(1, 1, smallSignature(1), t);
  EXPECT_DOUBLE_EQ(map.places()[1].frame_from_base.x_m, -0.1);
  EXPECT_NEAR(std::sqrt(map.places()[1].covariance(0, 0)), 0.004, 1e-5);
  map.add(2, 2, smallSignature(2), turnAndDifference(0.0, 0.6));  // no wheels: scale 1/3
  EXPECT_NEAR(map.places()[2].frame_from_base.x_m, 0.1, 1e-12);
}

TEST(TopologicalMap, LoopClosureBendsPathBack) {
  TopologicalMap map("r1", "r1", smallFormat());
  map.add(0, 0, smallSignature(0), std::nullopt);
  // A square of 4 × 1 m whose turns are measured 2° too small each.
  const double bias = 2.0 * M_PI / 180.0;
  for (unsigned i = 1; i <= 40; ++i) {
    Transition t = turnAndDifference(i % 10 == 0 ? M_PI / 2.0 - bias : 0.0, 0.1);
    t.turn_sigma_rad = 0.02;
    t.displacement_m = 0.1;
    map.add(i, i, smallSignature(i), t);
  }
  const double before = map.places().back().frame_from_base.translation().norm();
  ASSERT_GT(before, 0.05);
  // The true pose of the last place in the first. Links lie halfway between the headings, so corners are cut
  // by the same small amount in the measured path and in the true one.
  TopologicalMap truth("r1", "r1", smallFormat());
  truth.add(0, 0, smallSignature(0), std::nullopt);
  for (unsigned i = 1; i <= 40; ++i) {
    Transition t = turnAndDifference(i % 10 == 0 ? M_PI / 2.0 : 0.0, 0.1);
    t.displacement_m = 0.1;
    truth.add(i, i, smallSignature(i), t);
  }
  const Pose2 end = truth.places().back().frame_from_base;
  map.addLoop(0, 40, end, Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal());
  const double open_sigma = std::sqrt(map.places().back().covariance(0, 0));
  EXPECT_GT(map.optimise(), 0.02);
  EXPECT_LT((map.places().back().frame_from_base.translation() - end.translation()).norm(),
            0.01);  // σ of the loop
  double worst = 0.0;
  for (std::size_t i = 0; i < truth.places().size(); ++i)
    worst = std::max(worst, (truth.places()[i].frame_from_base.translation() -
                             map.places()[i].frame_from_base.translation())
                                .norm());
  EXPECT_LT(worst, 0.5 * before);
  EXPECT_LT(std::sqrt(map.places().back().covariance(0, 0)), 0.5 * open_sigma);
  ASSERT_EQ(map.places().back().links.size(), 2u);
  EXPECT_TRUE(map.places().back().links[1].closes_loop);
  EXPECT_EQ(map.places().back().links[1].index, 0u);
}

TEST(TopologicalMap, CovarianceFollowsErrorsOfTurns) {
  // Ten steps of 1 m straight ahead, each turn with σ 0.01: across, the last place has the closed-form
  // variance σ² Σ (k + ½)² to first order.
  TopologicalMapOptions options;
  TopologicalMap map("r1", "r1", smallFormat(), options);
  map.add(0, 0, smallSignature(0), std::nullopt);
  for (unsigned i = 1; i <= 10; ++i) {
    Transition t = turnAndDifference(0.0, 1.0);
    t.displacement_m = 1.0;
    map.add(i, i, smallSignature(i), t);
  }
  double sum = 0.0;
  for (int k = 0; k < 10; ++k)
    sum += k * k + 0.25;  // the direction of a step itself: half the turn, independent
  EXPECT_NEAR(map.places().back().covariance(1, 1), 1e-4 * sum, 0.02 * 1e-4 * sum);
  EXPECT_NEAR(map.places().back().covariance(2, 2), 10e-4, 1e-8);
}

TEST(TopologicalMap, RefusesBadInput) {
  TopologicalMap map("r1", "r1", smallFormat());
  EXPECT_THROW(map.add(0, 0, smallSignature(0), turnAndDifference(0.0, 1.0)), std::invalid_argument);
  map.add(0, 0, smallSignature(0), std::nullopt);
  EXPECT_THROW(map.add(1, 1, smallSignature(1), std::nullopt), std::invalid_argument);
  EXPECT_THROW(map.add(1, 1, StoredSignature{}, turnAndDifference(0.0, 1.0)), std::invalid_argument);
  EXPECT_THROW(map.add(1, 1, smallSignature(1), turnAndDifference(std::nan(""), 1.0)), std::invalid_argument);
  EXPECT_THROW(map.addLoop(0, 1, {}, Eigen::Matrix3d::Identity()), std::invalid_argument);
  map.add(1, 1, smallSignature(1), turnAndDifference(0.0, 1.0));
  EXPECT_THROW(map.addLoop(0, 1, {}, Eigen::Matrix3d::Zero()), std::invalid_argument);
  EXPECT_EQ(map.places().size(), 2u);
}

TEST(KeyframePolicy, FollowsItsRule) {
  KeyframePolicy policy;
  policy.rule = KeyframeRule::kEveryImage;
  EXPECT_TRUE(policy.isKeyframe(1, 0.0, 0.0));
  policy.rule = KeyframeRule::kEveryNth;
  policy.every = 3;
  EXPECT_FALSE(policy.isKeyframe(2, 9.0, 9.0));
  EXPECT_TRUE(policy.isKeyframe(3, 0.0, 0.0));
  policy.rule = KeyframeRule::kDistance;
  policy.distance_m = 0.1;
  EXPECT_FALSE(policy.isKeyframe(9, 0.09, 9.0));
  EXPECT_TRUE(policy.isKeyframe(1, 0.1, 0.0));
  policy.rule = KeyframeRule::kDifference;
  policy.difference = 0.2;
  EXPECT_FALSE(policy.isKeyframe(9, 9.0, 0.19));
  EXPECT_TRUE(policy.isKeyframe(1, 0.0, 0.2));
  EXPECT_EQ(KeyframePolicy::read(options::Section::parse("rule: every_nth", "t.yaml")).rule,
            KeyframeRule::kEveryNth);
}

}  // namespace
}  // namespace omnifleet::appearance
