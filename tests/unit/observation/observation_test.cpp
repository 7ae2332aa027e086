#include "observation/observation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace omnifleet {
namespace {

const Polygon kBox{{1.0, 0.5}, {1.4, 0.5}, {1.4, 0.8}, {1.0, 0.8}};

double support(const Polygon& points, const Eigen::Vector2d& c, double angle) {
  double best = -1e9;
  for (const auto& p : points)
    best = std::max(best, std::cos(angle) * (p - c).x() + std::sin(angle) * (p - c).y());
  return best;
}

TEST(SupportFunction, MatchesClosedFormAtItsDirections) {
  const Eigen::Vector2d c(0.1, -0.2);
  const SupportFunction s = SupportFunction::of(kBox, c, 0.01);
  ASSERT_EQ(s.size(), static_cast<std::size_t>(SupportFunction::kDirections));
  for (int k = 0; k < SupportFunction::kDirections; ++k) {
    // float: 24 bits of about one metre.
    EXPECT_NEAR(s.b_m[static_cast<std::size_t>(k)], support(kBox, c, 2 * M_PI * k / 96), 1e-7);
    EXPECT_NEAR(s.at(2 * M_PI * k / 96).b_m, support(kBox, c, 2 * M_PI * k / 96), 1e-6);
  }
}

// The value is exact between directions that one vertex supports. Elsewhere it is the corner outside the
// hull, which lies above it by at most (longest edge)·tan(step/2)/2.
TEST(SupportFunction, BoundsHullBetweenItsDirections) {
  const Eigen::Vector2d c(0, 0);
  const SupportFunction s = SupportFunction::of(kBox, c, 0.01);
  const double slack = 0.5 * 0.4 * std::tan(M_PI / 96);
  int exact = 0;
  for (double angle = -7.0; angle < 7.0; angle += 0.0137) {
    const double error = s.at(angle).b_m - support(kBox, c, angle);
    EXPECT_GT(error, -1e-6);
    EXPECT_LT(error, slack);
    exact += error < 1e-6;
  }
  EXPECT_GT(exact, 900) << "a box has four corners, so 92 of 96 gaps are exact";
}

TEST(SupportFunction, ReturnsNanBesideUnusableDirection) {
  SupportFunction s = SupportFunction::of(kBox, {0, 0}, 0.01, 8);
  s.sigma_m[2] = 0.0f;
  s.sigma_m[3] = 0.05f;
  const double step = M_PI / 4;
  EXPECT_TRUE(std::isnan(s.at(2 * step).b_m));
  EXPECT_TRUE(std::isnan(s.at(1.5 * step).b_m));
  EXPECT_TRUE(std::isnan(s.at(2.5 * step).b_m));
  EXPECT_NEAR(s.at(3 * step - 1e-12).b_m, s.b_m[3], 1e-6)
      << "rounding must not select the unusable neighbour";
  EXPECT_NEAR(s.at(3 * step + 1e-12).b_m, s.b_m[3], 1e-6);
  EXPECT_NEAR(s.at(3.5 * step).sigma_m, 0.05, 1e-7) << "the larger σ of the two neighbours";
  EXPECT_TRUE(SupportFunction::of({}, {0, 0}, 0.01).empty());
  EXPECT_TRUE(std::isnan(SupportFunction().at(0.0).b_m));
}

TEST(RobotBody, ReturnsOutlineOfRoundAndPolygonalBody) {
  RobotBody round;
  round.radius_m = 0.15;
  EXPECT_EQ(round.outline().size(), 48u);
  RobotBody square;
  square.footprint_m = kBox;
  EXPECT_EQ(square.outline(), kBox);
}

TEST(Names, DistinguishesEveryFrameState) {
  std::set<std::string> states;
  for (int i = 0; i <= static_cast<int>(FrameState::kOutOfOrder); ++i)
    states.insert(toString(static_cast<FrameState>(i)));
  EXPECT_EQ(states.size(), 10u);
  EXPECT_STREQ(toString(ObjectKind::kRobot), "robot");
  EXPECT_STREQ(toString(ObjectKind::kObstacle), "obstacle");
}

}  // namespace
}  // namespace omnifleet
