#include "evaluation/overlap.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <random>

namespace omnifleet::evaluation {
namespace {

Polygon square(double x, double y, double side) {
  return {{x, y}, {x + side, y}, {x + side, y + side}, {x, y + side}};
}

Polygon rotated(const Polygon& polygon, double angle) {
  Polygon result;
  for (const auto& p : polygon) result.emplace_back(Eigen::Rotation2Dd(angle) * p);
  return result;
}

// Boost snaps to a grid of about 1e-7 of the extent for robustness. 1e-6 m² is 1 mm².
constexpr double kTolerance = 1e-6;

TEST(Overlap, MatchesClosedFormOfSquares) {
  EXPECT_NEAR(intersectionArea(square(0, 0, 1), square(0.25, 0.5, 1)), 0.75 * 0.5, kTolerance);
  EXPECT_NEAR(intersectionOverUnion(square(0, 0, 1), square(0.25, 0.5, 1)), 0.375 / 1.625, kTolerance);
  EXPECT_NEAR(intersectionOverUnion(square(3, -7, 2), square(3, -7, 2)), 1.0, kTolerance);
  EXPECT_NEAR(intersectionOverUnion(square(0, 0, 2), square(0.5, 0.5, 1)), 0.25, kTolerance)
      << "one is inside the other";
  EXPECT_EQ(intersectionOverUnion(square(0, 0, 1), square(5, 5, 1)), 0.0);
  EXPECT_NEAR(intersectionArea(square(0, 0, 1), square(1, 0, 1)), 0.0, kTolerance)
      << "only an edge in common";
}

// A square and the same square rotated by 45° intersect in a regular octagon: area 2(√2 − 1)·side².
TEST(Overlap, MatchesOctagonOfRotatedSquares) {
  const Polygon a = square(-0.5, -0.5, 1.0);
  EXPECT_NEAR(intersectionArea(a, rotated(a, M_PI / 4)), 2.0 * (std::sqrt(2.0) - 1.0), kTolerance);
}

// Two circles of radius r at distance d: 2r² acos(d/2r) − d/2·√(4r² − d²). 2000-gons approximate it to 1e-5.
TEST(Overlap, MatchesClosedFormOfCircles) {
  const double r = 0.4, d = 0.3;
  const double lens = 2 * r * r * std::acos(d / (2 * r)) - 0.5 * d * std::sqrt(4 * r * r - d * d);
  EXPECT_NEAR(intersectionArea(circlePolygon({10, 20}, r, 2000), circlePolygon({10 + d, 20}, r, 2000)), lens,
              1e-5);
}

// An L and a square in its notch do not overlap, although their hulls do.
TEST(Overlap, IntersectsConcavePolygons) {
  const Polygon l{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  EXPECT_NEAR(intersectionArea(l, square(1.2, 1.2, 0.7)), 0.0, kTolerance);
  EXPECT_NEAR(intersectionArea(l, square(0.5, 0.5, 1)), 0.75, kTolerance);
  EXPECT_NEAR(intersectionOverUnion(l, square(0, 0, 2)), 0.75, kTolerance);
  const Polygon u{{0, 0}, {3, 0}, {3, 2}, {2, 2}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  EXPECT_NEAR(intersectionArea(u, {{-1, 1.5}, {4, 1.5}, {4, 3}, {-1, 3}}), 1.0, kTolerance)
      << "the intersection has two parts";
}

TEST(Overlap, IgnoresOrientationAndOrder) {
  const Polygon a = square(0, 0, 1), b{{0.25, 1.5}, {1.25, 1.5}, {1.25, 0.5}, {0.25, 0.5}};
  EXPECT_NEAR(intersectionOverUnion(a, b), 0.375 / 1.625, kTolerance);
  EXPECT_NEAR(intersectionOverUnion(b, a), 0.375 / 1.625, kTolerance);
}

TEST(Overlap, ReturnsZeroForDegeneratePolygons) {
  EXPECT_EQ(intersectionOverUnion({}, square(0, 0, 1)), 0.0);
  EXPECT_EQ(intersectionOverUnion({{0, 0}, {1, 1}}, square(0, 0, 1)), 0.0);
  EXPECT_EQ(intersectionOverUnion({{0, 0}, {1, 1}, {2, 2}}, square(0, 0, 1)), 0.0);
  const Polygon bowtie{{0, 0}, {1, 1}, {1, 0}, {0, 1}};
  EXPECT_NEAR(intersectionOverUnion(bowtie, square(0, 0, 1)), 1.0, kTolerance)
      << "a self-intersecting polygon is replaced by its hull";
}

// The area of the intersection by counting random points: an independent, coarse reference.
TEST(Overlap, MatchesMonteCarlo) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0.0, 1.0);
  for (int trial = 0; trial < 10; ++trial) {
    const auto star = [&](double x, double y) {
      Polygon polygon;
      for (int i = 0; i < 11; ++i) {
        const double r = 0.15 + 0.3 * number(random), a = 2 * M_PI * i / 11;
        polygon.emplace_back(x + r * std::cos(a), y + r * std::sin(a));
      }
      return polygon;
    };
    const Polygon a = star(0.45, 0.5), b = star(0.6, 0.5);
    int both = 0;
    constexpr int kPoints = 40000;
    for (int i = 0; i < kPoints; ++i) {
      const Eigen::Vector2d p(2 * number(random) - 0.5, 2 * number(random) - 0.5);
      both += contains(a, p) && contains(b, p);
    }
    const double counted = 4.0 * both / kPoints;
    // Four standard deviations of the count: 4·√(p(1 − p)/n) ≤ 0.006.
    EXPECT_NEAR(intersectionArea(a, b), counted, 0.024);
  }
}

}  // namespace
}  // namespace omnifleet::evaluation
