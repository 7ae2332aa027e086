#include "geometry/polygon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace omnifleet {
namespace {

const Polygon kL{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};

TEST(SignedArea, MatchesClosedForms) {
  EXPECT_DOUBLE_EQ(signedArea(kL), 3.0);
  EXPECT_DOUBLE_EQ(signedArea(Polygon(kL.rbegin(), kL.rend())), -3.0);
  EXPECT_EQ(signedArea({{0, 0}, {1, 1}}), 0.0);
  // Regular n-gon in a circle: n/2·r²·sin(2π/n).
  EXPECT_NEAR(signedArea(circlePolygon({3, 4}, 2.0, 7)), 3.5 * 4.0 * std::sin(2 * M_PI / 7), 1e-13);
}

TEST(Centroid, WeighsAreaNotVertices) {
  // The L is a 2×1 box and a 1×1 box: (2·(1, 0.5) + 1·(0.5, 1.5))/3.
  EXPECT_LT((centroid(kL) - Eigen::Vector2d(2.5 / 3, 2.5 / 3)).norm(), 1e-15);
  Polygon far;
  for (const auto& p : kL) far.push_back(p + Eigen::Vector2d(1e6, -1e6));
  EXPECT_LT((centroid(far) - Eigen::Vector2d(1e6 + 2.5 / 3, -1e6 + 2.5 / 3)).norm(), 1e-9)
      << "precision is kept far from the origin";
  EXPECT_EQ(centroid({{1, 1}, {3, 5}}), Eigen::Vector2d(2, 3)) << "zero area: mean of the vertices";
  EXPECT_EQ(centroid({}), Eigen::Vector2d(0, 0));
}

TEST(Contains, AcceptsInsideAndBorderRejectsOutside) {
  EXPECT_TRUE(contains(kL, {0.5, 1.5}));
  EXPECT_FALSE(contains(kL, {1.5, 1.5})) << "inside the notch";
  EXPECT_TRUE(contains(kL, {1.0, 1.5})) << "on an edge";
  EXPECT_TRUE(contains(kL, {2.0, 1.0})) << "on a vertex";
  EXPECT_FALSE(contains(kL, {-1e-9, 1.0}));
  EXPECT_FALSE(contains(kL, {3.0, 1.0})) << "the test ray passes through a vertex";
  EXPECT_FALSE(contains({}, {0, 0}));
}

TEST(CirclePolygon, PlacesVerticesOnTheCircle) {
  const Polygon circle = circlePolygon({1, -2}, 0.5, 12);
  ASSERT_EQ(circle.size(), 12u);
  for (const auto& p : circle) EXPECT_NEAR((p - Eigen::Vector2d(1, -2)).norm(), 0.5, 1e-15);
  EXPECT_GT(signedArea(circle), 0.0);
}

}  // namespace
}  // namespace omnifleet
