// Keyframes of a scanner with a field of view of 180°. References depend on the overlap of the views, not on
// the position alone. Views of 180° that are turned by α overlap by 1 − α/π.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimation/keyframe_map.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

constexpr double kDegree = M_PI / 180.0;

/// Scan of the furnished room. @param view_rad of the scanner, about its axis at bearing `axis_rad`
scan::LineScan scanWithView(const Pose2& pose, double view_rad, double axis_rad = 0.0) {
  std::mt19937 random(1);
  Boundary boundary = scan::testing::furnishedRoom().scan(pose, 0.003, random);
  const std::size_t n = boundary.inverse_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double bearing = wrapAngle(2.0 * M_PI * static_cast<double>(i) / static_cast<double>(n) - axis_rad);
    if (std::abs(bearing) > 0.5 * view_rad) boundary.inverse_m[i] = boundary.sigma[i] = 0.0f;
  }
  scan::LineScan scan;
  scan.fit(boundary);
  return scan;
}

/// One keyframe in the middle of the room.
struct OneView {
  static constexpr double kHeading_rad = 2.5;
  KeyframeMap map{KeyframeOptions{}};

  explicit OneView(double view_rad, double axis_rad = 0.0) {
    KeyframeMap::Held held;
    held.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    const Pose2 pose{0.0, 0.0, kHeading_rad};
    map.add(pose, {}, scanWithView(pose, view_rad, axis_rad), held, {});
  }

  static Pose2 turned(double by_rad) { return {0.0, 0.0, wrapAngle(kHeading_rad + by_rad)}; }
  static KeyframeMap::Viewpoint viewpoint(double by_rad, double view_rad) {
    return {turned(by_rad), scanWithView(turned(by_rad), view_rad).sectors()};
  }
  bool isReference(double by_rad, double view_rad) const {
    const KeyframeMap::Viewpoint at = viewpoint(by_rad, view_rad);
    const bool is_nearest = !map.nearest(at, map.all()).empty();
    EXPECT_EQ(!map.references(0, 0.0, at).empty(), is_nearest);
    EXPECT_EQ(!map.references(0.0, at).empty(), is_nearest);
    return is_nearest;
  }
  bool wants(double by_rad, double view_rad) const {
    return map.wants(viewpoint(by_rad, view_rad), map.all(), scanWithView(turned(by_rad), view_rad));
  }
};

TEST(KeyframeOverlap, OppositeViewsAreNoReferences) {
  const OneView one(M_PI);
  // The minimum overlap is 0.3, at 126° ± a sector of 5.6°.
  for (const double degrees : {0.0, 60.0, -60.0, 115.0, -115.0})
    EXPECT_TRUE(one.isReference(degrees * kDegree, M_PI)) << degrees;
  for (const double degrees : {137.0, -137.0, 180.0})
    EXPECT_FALSE(one.isReference(degrees * kDegree, M_PI)) << degrees;
}

TEST(KeyframeOverlap, ScannerOfTheFullCircleOverlapsAtAllHeadings) {
  const OneView one(2.0 * M_PI);
  for (const double degrees : {0.0, 90.0, 180.0, -90.0}) {
    EXPECT_TRUE(one.isReference(degrees * kDegree, 2.0 * M_PI)) << degrees;
    EXPECT_TRUE(one.isReference(degrees * kDegree, M_PI)) << degrees;
    EXPECT_FALSE(one.wants(degrees * kDegree, 2.0 * M_PI)) << degrees;
    EXPECT_FALSE(one.wants(degrees * kDegree, M_PI)) << degrees;
  }
}

TEST(KeyframeOverlap, ScannerOfAHalfCircleNeedsANewKeyframeAfterATurn) {
  const OneView one(M_PI);
  // The overlap is 0.7 at 54°.
  for (const double degrees : {0.0, 43.0, -43.0}) EXPECT_FALSE(one.wants(degrees * kDegree, M_PI)) << degrees;
  for (const double degrees : {65.0, -65.0, 180.0})
    EXPECT_TRUE(one.wants(degrees * kDegree, M_PI)) << degrees;
  EXPECT_TRUE(one.wants(0.0, 2.0 * M_PI)) << "the keyframe has measured half of the full circle";
}

TEST(KeyframeOverlap, NarrowViewOverlapsOnTheMeasuredSideOnly) {
  const OneView left(M_PI, 0.5 * M_PI);
  const double narrow_rad = 60.0 * kDegree;
  EXPECT_TRUE(left.isReference(0.5 * M_PI, narrow_rad));
  EXPECT_FALSE(left.wants(0.5 * M_PI, narrow_rad));
  EXPECT_FALSE(left.isReference(-0.5 * M_PI, narrow_rad));
  EXPECT_TRUE(left.wants(-0.5 * M_PI, narrow_rad));
}

TEST(KeyframeOverlap, PoseWithoutScanOverlapsWithAllKeyframes) {
  const OneView one(M_PI);
  EXPECT_EQ(one.map.nearest(OneView::turned(M_PI), one.map.all()).size(), 1U);
  EXPECT_EQ(one.map.nearest({OneView::turned(M_PI), 0}, one.map.all()).size(), 1U) << "nothing measured";
}

}  // namespace
}  // namespace omnifleet::estimation
