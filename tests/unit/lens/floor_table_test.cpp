#include "lens/floor_table.h"

#include <gtest/gtest.h>

#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

CameraModel downward(CameraModel m) {
  m.position_m = {0.02, -0.01, 0.5};
  m.rotation_rpy_deg = {0.4, -0.3, 5.0};
  return m;
}

/// Largest error over sub-pixel positions, in pixels of that position: metres ÷ metres per pixel (radially).
double worstError_px(const CameraModel& m, int step_px, double last_m, double plane_m) {
  const Camera camera(m);
  const FloorTable table(camera, step_px);
  double worst = 0.0;
  for (double v = 3.0; v < m.image_height_px; v += 4.37) {
    for (double u = 3.0; u < m.image_width_px; u += 5.13) {
      const auto exact = camera.planeFromPixel({u, v}, plane_m);
      if (!exact || exact->norm() > last_m) continue;
      const Eigen::Vector2d outward = (Eigen::Vector2d(u, v) - m.principal_point_px).normalized();
      const auto next = camera.planeFromPixel(Eigen::Vector2d(u, v) + 0.1 * outward, plane_m);
      if (!next) continue;
      const double metres_per_px = (*next - *exact).norm() / 0.1;
      const Eigen::Vector2f got =
          table.at(static_cast<float>(u), static_cast<float>(v), static_cast<float>(plane_m));
      worst = std::max(worst, (got.cast<double>() - *exact).norm() / metres_per_px);
    }
  }
  return worst;
}

// Contours are accurate to 0.2–0.4 px, so 0.01 px is negligible. With step 1 only the rounding of float
// remains.
TEST(FloorTable, KeepsErrorBelowThatOfContours) {
  for (const CameraModel& m :
       {downward(model(Projection::kEquidistant)), downward(model(Projection::kStereographic)),
        downward(model(Projection::kEquisolid)), downward(simulatedOcam()),
        downward(simulatedKannalaBrandt())}) {
    const double coarse = worstError_px(m, 4, 4.0, 0.0), fine = worstError_px(m, 1, 4.0, 0.1);
    RecordProperty("step4_px_" + std::to_string(static_cast<int>(m.projection)), std::to_string(coarse));
    RecordProperty("step1_px_" + std::to_string(static_cast<int>(m.projection)), std::to_string(fine));
    EXPECT_LT(coarse, 0.01);
    EXPECT_LT(fine, 0.002);
  }
}

TEST(FloorTable, ReturnsNanAboveHorizonAndOutsideImage) {
  const CameraModel m = downward(model(Projection::kEquidistant));
  const FloorTable table{Camera(m)};
  const float cx = 641.3f, cy = 478.2f, f = 297.0f;
  EXPECT_TRUE(table.at(cx, cy).allFinite());
  EXPECT_TRUE(std::isnan(table.at(cx + f * 1.59f, cy).x())) << "91° is above the horizon";
  EXPECT_TRUE(table.ray(cx + f * 1.59f, cy).allFinite()) << "but inside the field of view";
  EXPECT_TRUE(std::isnan(table.ray(cx + f * 1.65f, cy).x())) << "94.5° is outside the field of view";
  EXPECT_TRUE(std::isnan(table.at(-30.0f, 100.0f).x()));
  EXPECT_TRUE(std::isnan(table.at(100.0f, 5000.0f).x()));
  EXPECT_TRUE(std::isnan(table.at(std::nanf(""), 100.0f).x()));
}

// At the edge of the field of view lattice points are missing; there the exact function answers.
TEST(FloorTable, IsCompleteUpToEdgeOfFieldOfView) {
  CameraModel m = downward(model(Projection::kEquidistant, 160.0));
  const Camera camera(m);
  const FloorTable table(camera, 8);
  for (double v = 0.5; v < m.image_height_px; v += 3.7) {
    for (double u = 0.5; u < m.image_width_px; u += 3.3) {
      const auto exact = camera.floorFromPixel({u, v});
      const double r = (Eigen::Vector2d(u, v) - m.principal_point_px).cwiseQuotient(m.focal_px).norm();
      if (std::abs(r - 80.0 * kDeg) < 1e-5) continue;  // rounding to float may put the pixel on either side
      EXPECT_EQ(exact.has_value(), table.at(static_cast<float>(u), static_cast<float>(v)).allFinite())
          << u << " " << v;
    }
  }
}

}  // namespace
}  // namespace omnifleet::lens::test
