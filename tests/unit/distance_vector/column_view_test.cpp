#include "distance_vector/column_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/distance_vector/ray_caster.h"

namespace omnifleet::distance_vector {
namespace {

// The tables are linear between rows. The lens itself is the reference: within 1e-4 of the inverse range and
// 0.003° from the farthest row that is measured to the bottom.
TEST(ColumnView, AgreesWithTheLensBetweenPixels) {
  const lens::Camera camera(test::forwardCamera());
  const ColumnView view(camera, {});
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    const int u = static_cast<int>(random() % 320);
    const float low = static_cast<float>(view.limitRow(u));
    const float v = low + (239.0f - low) * std::uniform_real_distribution<float>(0, 1)(random);
    const auto floor = camera.floorFromPixel({static_cast<double>(u), static_cast<double>(v)});
    ASSERT_TRUE(floor);
    const Eigen::Vector2d d = *floor - camera.foot();
    EXPECT_NEAR(view.inverseRange(u, v) * static_cast<float>(d.norm()), 1.0f, 1e-4f) << u << " " << v;
    EXPECT_NEAR(view.bearing(u, v), static_cast<float>(std::atan2(d.y(), d.x())), 5e-5f);
  }
}

// A column of a pitched camera with a field of view of 90° is no bearing: it differs by several degrees from
// evenly spaced bearings (Ahmed et al. 2013, eq. 4).
TEST(ColumnView, BearingDiffersFromEvenlySpacedColumns) {
  const ColumnView view(lens::Camera(test::forwardCamera()), {});
  double worst_deg = 0.0;
  for (int u = 0; u < 320; ++u) {
    const double even_deg = 90.0 * (0.5 - (u + 0.5) / 320.0);
    for (int v = view.limitRow(u); v < 240; v += 5)
      worst_deg = std::max(
          worst_deg,
          std::abs(static_cast<double>(view.bearing(u, static_cast<float>(v))) * 180.0 / M_PI - even_deg));
  }
  EXPECT_GT(worst_deg, 3.0);
}

TEST(ColumnView, EndsBelowTheHorizon) {
  Options options;
  const ColumnView view(lens::Camera(test::forwardCamera()), options);
  for (int u = 0; u < 320; u += 7) {
    EXPECT_GE(view.limitRow(u) - view.horizonRow(u), 4);
    EXPECT_TRUE(view.seesHorizon(u));
  }
  options.max_range_m = 0.5;
  const ColumnView near(lens::Camera(test::forwardCamera()), options);
  EXPECT_NEAR(1.0 / static_cast<double>(near.inverseRange(160, static_cast<float>(near.limitRow(160)))), 0.5,
              0.02);
}

TEST(ColumnView, RejectsCamerasThatSeeNoFloor) {
  lens::CameraModel up = test::forwardCamera();
  up.rotation_rpy_deg = {0, -150, 0};
  EXPECT_THROW(ColumnView(lens::Camera(up), {}), options::Error);
  lens::CameraModel buried = test::forwardCamera();
  buried.position_m.z() = -0.1;
  EXPECT_THROW(ColumnView(lens::Camera(buried), {}), options::Error);
}

}  // namespace
}  // namespace omnifleet::distance_vector
