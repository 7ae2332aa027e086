#include "outline/polygon_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>

#include "outline/convex_hull.h"
#include "outline/half_planes.h"
#include "prism_scene.h"

namespace omnifleet {
namespace {

using outline::convexHull;
using testing::box;

Polygon cloud(std::mt19937& random, int count) {
  std::normal_distribution<double> normal;
  Polygon points;
  for (int i = 0; i < count; ++i) points.emplace_back(normal(random), normal(random));
  return points;
}

TEST(ConvexHull, AgreesWithOpenCv) {
  std::mt19937 random(1);
  for (int run = 0; run < 50; ++run) {
    Polygon points;
    std::vector<cv::Point2f> float_points, reference;
    for (const auto& p : cloud(random, 100)) {  // exactly representable in both
      float_points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
      points.emplace_back(float_points.back().x, float_points.back().y);
    }
    cv::convexHull(float_points, reference, true);
    const Polygon hull = convexHull(points);
    EXPECT_EQ(hull.size(), reference.size());
    EXPECT_NEAR(signedArea(hull), cv::contourArea(reference), 1e-5);  // float arithmetic in the reference
    EXPECT_GT(signedArea(hull), 0);
  }
}

TEST(ConvexHull, HandlesDegenerateInput) {
  EXPECT_TRUE(convexHull({}).empty());
  EXPECT_EQ(convexHull({{1, 2}}).size(), 1U);
  EXPECT_EQ(convexHull({{1, 2}, {1, 2}, {1, 2}}).size(), 1U);
  EXPECT_EQ(convexHull({{0, 0}, {1, 1}, {2, 2}, {0.5, 0.5}}).size(), 2U);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(convexHull({{0, 0}, {1, 0}, {nan, 1}, {0, 1}}).size(), 3U);
  // Collinear points on an edge are dropped. The first vertex is the smallest.
  const Polygon square = convexHull({{1, 1}, {0, 0}, {0.5, 0}, {1, 0}, {0, 1}, {0, 0.5}});
  ASSERT_EQ(square.size(), 4U);
  EXPECT_EQ(square.front(), Eigen::Vector2d(0, 0));
}

TEST(PolygonSet, UnitesSquaresAsInClosedForm) {
  // Two unit squares that share a quarter, and one separate square.
  const auto regions = outline::unite({box({0, 0}, 1, 1, 0), box({0.5, 0.5}, 1, 1, 0), box({5, 5}, 2, 1, 0)});
  ASSERT_EQ(regions.size(), 2U);
  EXPECT_NEAR(regions[0].area(), 1.75, 1e-12);
  EXPECT_EQ(regions[0].outer.size(), 8U);
  EXPECT_NEAR(regions[1].area(), 2.0, 1e-12);
  EXPECT_NEAR(outline::area(regions), 3.75, 1e-12);
}

TEST(PolygonSet, IgnoresOrderAndOrientation) {
  std::mt19937 random(2);
  std::vector<Polygon> polygons;
  for (int i = 0; i < 12; ++i) {
    auto c = cloud(random, 6);
    for (auto& p : c) p += 2.0 * cloud(random, 1).front();
    polygons.push_back(convexHull(c));
  }
  const double reference = outline::area(outline::unite(polygons));
  std::shuffle(polygons.begin(), polygons.end(), random);
  for (auto& p : polygons) std::reverse(p.begin(), p.end());
  EXPECT_NEAR(outline::area(outline::unite(polygons)), reference, 1e-9);
}

TEST(PolygonSet, SubtractsToARegionWithAHole) {
  const auto ring = outline::subtract({box({0, 0}, 4, 4, 0)}, {box({0, 0}, 2, 1, 0)});
  ASSERT_EQ(ring.size(), 1U);
  ASSERT_EQ(ring[0].holes.size(), 1U);
  EXPECT_NEAR(ring[0].area(), 14.0, 1e-12);
  EXPECT_LT(signedArea(ring[0].holes[0]), 0);
  EXPECT_TRUE(outline::subtract({box({0, 0}, 1, 1, 0)}, {box({0, 0}, 2, 2, 0)}).empty());
}

TEST(PolygonSet, ComputesIouAsInClosedForm) {
  EXPECT_NEAR(outline::iou(box({0, 0}, 1, 1, 0), box({0.5, 0}, 1, 1, 0)), 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(outline::iou(box({0, 0}, 1, 1, 0.3), box({0, 0}, 1, 1, 0.3)), 1.0, 1e-12);
  EXPECT_EQ(outline::iou(box({0, 0}, 1, 1, 0), box({3, 0}, 1, 1, 0)), 0.0);
  EXPECT_EQ(outline::iou({}, box({3, 0}, 1, 1, 0)), 0.0);
}

TEST(PolygonSet, HandlesSelfIntersectingAndInvalidInput) {
  const Polygon bow_tie{{0, 0}, {1, 1}, {1, 0}, {0, 1}};  // replaced by its hull, the unit square
  EXPECT_NEAR(outline::area(outline::unite({bow_tie})), 1.0, 1e-12);
  EXPECT_TRUE(outline::unite({{{0, 0}, {1, 1}}, {{0, 0}, {1, 1}, {2, 2}}}).empty());
  EXPECT_NEAR(outline::area(outline::unite({{{0, 0}, {0, 0}, {1, 0}, {1, 1}, {0, 0}}})), 0.5, 1e-12);
}

TEST(PolygonSet, OverlaysThreeMapsByVotes) {
  const std::vector<std::vector<Polygon>> maps{
      {box({0, 0}, 2, 2, 0)}, {box({1, 0}, 2, 2, 0)}, {box({0, 0}, 1, 1, 0), box({9, 9}, 1, 1, 0)}};
  EXPECT_NEAR(outline::area(outline::overlay(maps, 1)), 7.0, 1e-12);
  // Two votes: the strip that both large squares share (1 × 2), and the left half of the small square beside
  // it (0.5 × 1).
  EXPECT_NEAR(outline::area(outline::overlay(maps, 2)), 2.5, 1e-12);
  EXPECT_NEAR(outline::area(outline::overlay(maps, 3)), 0.5, 1e-12);
  EXPECT_TRUE(outline::overlay(maps, 4).empty());
}

TEST(HalfPlanes, ReconstructPolygonFromItsSupports) {
  std::mt19937 random(3);
  for (int run = 0; run < 20; ++run) {
    const Polygon polygon = convexHull(cloud(random, 12));
    std::vector<outline::HalfPlane> planes;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector2d edge = polygon[(i + 1) % polygon.size()] - polygon[i];
      const Eigen::Vector2d normal(edge.y(), -edge.x());
      planes.push_back({normal, normal.dot(polygon[i])});
    }
    std::shuffle(planes.begin(), planes.end(), random);
    EXPECT_NEAR(outline::convexIou(outline::intersectHalfPlanes(planes), polygon), 1.0, 1e-9);
  }
  EXPECT_TRUE(outline::intersectHalfPlanes({{{1, 0}, -1}, {{-1, 0}, -1}}).empty());
}

TEST(HalfPlanes, ComputeSameIouAsExactArithmetic) {
  std::mt19937 random(4);
  for (int run = 0; run < 30; ++run) {
    const Polygon a = convexHull(cloud(random, 10)), b = convexHull(cloud(random, 10));
    EXPECT_NEAR(outline::convexIou(a, b), outline::iou(a, b), 1e-9);
  }
}

}  // namespace
}  // namespace omnifleet
