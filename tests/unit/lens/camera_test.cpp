#include <gtest/gtest.h>

#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

TEST(Extrinsics, MapsForwardUpAndLeftLeftForDownwardCamera) {
  CameraModel m = model(Projection::kEquidistant);
  m.position_m = {0.0, 0.0, 0.5};
  const Camera camera(m);
  const Eigen::Vector2d ahead = *camera.pixelFromPoint({1.0, 0.0, 0.0}),
                        left = *camera.pixelFromPoint({0.0, 1.0, 0.0});
  EXPECT_NEAR(ahead.x(), m.principal_point_px.x(), 1e-9);
  EXPECT_LT(ahead.y(), m.principal_point_px.y());
  EXPECT_LT(left.x(), m.principal_point_px.x());
  EXPECT_NEAR(left.y(), m.principal_point_px.y(), 1e-9);
  // Equidistant: r = F·θ, tan θ = 1 m / 0.5 m.
  EXPECT_NEAR(m.principal_point_px.y() - ahead.y(), m.focal_px.y() * std::atan2(1.0, 0.5), 1e-9);
}

TEST(Extrinsics, AlignsAxisWithXForForwardCamera) {
  CameraModel m = pinhole({});
  m.position_m = {0.1, 0.0, 0.3};
  m.rotation_rpy_deg = {0.0, -90.0, 0.0};
  const Camera camera(m);
  const Eigen::Matrix3d r = camera.parentFromCamera().linear();
  EXPECT_LT((r.col(2) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);   // optical axis
  EXPECT_LT((r.col(0) - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12);  // image right
  EXPECT_LT((r.col(1) - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12);  // image down
  const auto floor = camera.floorFromPixel(m.principal_point_px + Eigen::Vector2d(0.0, 815.0 * 0.3 / 2.0));
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->x(), 2.1, 1e-9);
  EXPECT_FALSE(camera.floorFromPixel(m.principal_point_px)) << "the horizon is not on the floor";
  EXPECT_FALSE(camera.floorFromPixel(m.principal_point_px - Eigen::Vector2d(0.0, 10.0)));
}

// Choi et al. 2014, eq. 6–7 for the orthographic lens: floor point = (x_d, y_d)·L/F·(height/F), L = F²/√(F² −
// r²).
TEST(Choi, MatchesCorrectionOfFeaturePoints) {
  CameraModel m = model(Projection::kOrthographic);
  m.focal_px = {300.0, 300.0};
  m.position_m = {0.0, 0.0, 0.42};
  const Camera camera(m);
  for (double x_d = -290.0; x_d <= 290.0; x_d += 29.0) {
    for (double y_d = -290.0; y_d <= 290.0; y_d += 29.0) {
      const double r_d = std::hypot(x_d, y_d), f = 300.0;
      const auto floor = camera.floorFromPixel(m.principal_point_px + Eigen::Vector2d(x_d, y_d));
      ASSERT_EQ(static_cast<bool>(floor), r_d < f);
      if (!floor) continue;
      const double l = f * f / std::sqrt(f * f - r_d * r_d);
      const Eigen::Vector2d u(x_d * l / f, y_d * l / f);  // eq. 6
      const Eigen::Vector2d expected(-u.y() * 0.42 / f,
                                     -u.x() * 0.42 / f);  // image up is forward, image left is left
      EXPECT_LT((*floor - expected).norm(), 1e-9 * (1.0 + expected.norm() * expected.norm()));
    }
  }
}

TEST(Camera, InvertsPlaneAndPointProjection) {
  CameraModel m = simulatedOcam();
  m.position_m = {0.05, -0.02, 0.55};
  m.rotation_rpy_deg = {1.3, -2.1, 14.0};
  const Camera camera(m);
  for (const double height_m : {0.0, 0.12, 0.3}) {
    for (double x = -2.0; x <= 2.0; x += 0.37) {
      const Eigen::Vector3d point(x, 0.8 - 0.3 * x, height_m);
      const auto pixel = camera.pixelFromPoint(point);
      ASSERT_TRUE(pixel);
      const auto back = camera.planeFromPixel(*pixel, height_m);
      ASSERT_TRUE(back);
      EXPECT_LT((*back - point.head<2>()).norm(), 1e-10);
    }
  }
}

TEST(Camera, MapsFloorPixelToMapForCeilingCamera) {
  CameraModel m = pinhole({-0.1, 0.01, 0.0, 0.0, 0.0});
  m.position_m = {-0.75, 0.2, 3.0};
  m.rotation_rpy_deg = {2.0, 1.0, 90.0};
  const Camera camera(m);
  const auto pixel = camera.pixelFromPoint({-0.4, 0.6, 0.3});
  ASSERT_TRUE(pixel);
  EXPECT_LT((*camera.planeFromPixel(*pixel, 0.3) - Eigen::Vector2d(-0.4, 0.6)).norm(), 1e-11);
  EXPECT_EQ(camera.foot(), Eigen::Vector2d(-0.75, 0.2));
  EXPECT_EQ(camera.height(), 3.0);
}

}  // namespace
}  // namespace omnifleet::lens::test
