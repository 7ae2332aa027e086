#include "evaluation/solid_metrics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::evaluation {
namespace {

const Polygon kSquare{{0, 0}, {1, 0}, {1, 1}, {0, 1}};

TEST(SurfaceDistance, MeasuresDistanceToBox) {
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {0.5, 0.9, 0.2}), -0.1);    // the side is nearest
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {0.5, 0.5, 0.45}), -0.05);  // the top is nearest
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {0.5, 0.5, 0.7}), 0.2);
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {1.3, 0.5, 0.2}), 0.3);
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {1.3, 1.4, 0.1}), 0.5);  // beside the corner
  EXPECT_DOUBLE_EQ(surfaceDistance(kSquare, 0.5, {1.3, 0.5, 0.9}), 0.5);  // beside and above
}

TEST(CompareSolids, MeasuresDistanceOutsideNearestSolid) {
  dataset::MapObject box, flat;
  box.outline_m = kSquare;
  box.height_m = 0.5;
  flat.outline_m = {{5, 5}, {6, 5}, {6, 6}};  // of unknown height
  const auto metrics =
      compareSolids({box, flat}, {{0.5, 0.5, 0.1}, {1.1, 0.5, 0.1}, {1.3, 0.5, 0.1}, {0.2, 0.5, 0.1}});
  EXPECT_EQ(metrics.points, 4);
  EXPECT_EQ(metrics.median_m, 0.0);
  EXPECT_NEAR(metrics.share90_m, 0.1, 1e-12);
  EXPECT_NEAR(metrics.max_m, 0.3, 1e-12);
}

TEST(CompareSolids, ReturnsNanWithoutPointsOrSolids) {
  dataset::MapObject flat;
  flat.outline_m = kSquare;
  EXPECT_EQ(compareSolids({flat}, {{0, 0, 0}}).points, 0);
  EXPECT_TRUE(std::isnan(compareSolids({}, {}).median_m));
}

}  // namespace
}  // namespace omnifleet::evaluation
