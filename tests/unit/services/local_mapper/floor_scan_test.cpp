#include <gtest/gtest.h>

#include <cmath>

#include "local_mapper/floor_scan.h"
#include "tests/unit/services/local_mapper/fisheye_scene.h"

namespace omnifleet::local_mapper {
namespace {

class FloorScanTest : public ::testing::Test {
 protected:
  FloorScanTest() : camera_(testing::fisheyeModel()), view_(camera_, {}), scan_(camera_, view_, {}) {}

  static FloorContour contourOf(const Polygon& corners) {
    FloorContour contour;
    contour.loop_begin.push_back(0);
    for (std::size_t i = 0; i < corners.size(); ++i)
      for (int k = 0; k < 40; ++k)
        contour.points_m.push_back(corners[i] + k / 40.0 * (corners[(i + 1) % corners.size()] - corners[i]));
    return contour;
  }
  static double rayTo(const Polygon& corners, double bearing) {
    const Eigen::Vector2d n(std::cos(bearing), std::sin(bearing)), side(-n.y(), n.x());
    double nearest = 1e9;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const auto &a = corners[i], &b = corners[(i + 1) % corners.size()];
      const double da = side.dot(a), db = side.dot(b);
      if (da * db > 0 || da == db) continue;
      const double range = n.dot(a + da / (da - db) * (b - a));
      if (range > 0) nearest = std::min(nearest, range);
    }
    return nearest;
  }

  lens::Camera camera_;
  ground::FloorView view_;
  FloorScan scan_;
};

TEST_F(FloorScanTest, EndsRaysOfFreeFloorAtMaximumRange) {
  Scan scan;
  scan_.begin();
  scan_.finish(scan);
  ASSERT_EQ(scan.range_m.size(), 360U);
  for (std::size_t i = 0; i < 360; ++i) {
    EXPECT_EQ(scan.label[i], RayLabel::kFloorEnd);
    EXPECT_NEAR(scan.range_m[i], 2.5, 0.011);  // one step of the march
    EXPECT_EQ(scan.object[i], 0);
  }
  // One pixel radially at range r: dr/dθ ÷ f, r = H·tan θ.
  const double expected = (0.25 + 2.5 * 2.5) / 0.5 / 148.66;
  EXPECT_NEAR(scan.sigma_m[10], expected, 0.05 * expected);
}

TEST_F(FloorScanTest, ReportsBlindRadiusOfOwnBody) {
  Scan scan;
  scan_.begin();
  scan_.finish(scan);
  const double mask_px = 99.0 + ground::ViewOptions().mask_margin_px;
  EXPECT_NEAR(scan.blind_m, 0.5 * std::tan(mask_px / 148.66), 0.02);  // a step of the march and a pixel
}

/// A narrow lens: an object at the edge of its view is not visible there, but an obstacle.
TEST_F(FloorScanTest, EndsFloorBeforeEdgeOfView) {
  lens::CameraModel model = camera_.model();
  model.fov_deg = 140.0;
  const lens::Camera narrow(model);
  const ground::ViewOptions options;
  FloorScan scan(narrow, ground::FloorView(narrow, options), {});
  Scan seen;
  scan.begin();
  scan.finish(seen);
  const double edge_px = 148.66 * 70.0 * M_PI / 180.0 - options.border_margin_px;
  const double sure_m = 0.5 * std::tan((edge_px - options.cut_reach_px) / 148.66);
  for (std::size_t i = 0; i < 360; ++i) {
    EXPECT_EQ(seen.label[i], RayLabel::kFloorEnd) << i;
    EXPECT_NEAR(seen.range_m[i], sure_m, 0.03) << i;  // pixel rounding: 2 cm
  }
}

TEST_F(FloorScanTest, EndsKnownFloorAtUndecidedRegion) {
  ground::Blob blob;  // a patch of 20 × 20 px ahead
  const auto pixel = camera_.pixelFromPoint({1.2, 0.0, 0.0});
  ASSERT_TRUE(pixel);
  const int u = static_cast<int>(pixel->x()), v = static_cast<int>(pixel->y());
  for (int row = v - 10; row < v + 10; ++row) blob.runs.push_back({row, u - 10, u + 10});
  Scan scan;
  scan_.begin();
  const auto begins_m = scan_.addUndecided(blob, FloorScan::Candidate::kRegion);
  scan_.finish(scan);
  const auto nearest = camera_.floorFromPixel({u, v + 9});
  ASSERT_TRUE(nearest);
  EXPECT_EQ(scan.label[0], RayLabel::kUndecided);
  EXPECT_NEAR(scan.range_m[0], nearest->norm(), 0.002);  // the ray passes within half a pixel
  EXPECT_EQ(scan.object[0], 0);
  ASSERT_TRUE(begins_m);
  EXPECT_NEAR(begins_m->norm(), nearest->norm(), 0.002);
  EXPECT_NEAR(scan.range_m[180], 2.5, 0.011);
  scan_.begin();
  scan_.finish(scan);
  EXPECT_NEAR(scan.range_m[0], 2.5, 0.011);
}

TEST_F(FloorScanTest, HitsNearestEdgeOfEachBearing) {
  const Polygon front = testing::box(1.0, 0.3, 0.3, 0.2, 0.5), behind = testing::box(1.7, 0.4, 0.4, 0.4, 0.0),
                across = testing::box(-0.9, 0.0, 0.2, 0.5, 0.1);  // over ±π
  Scan scan;
  scan_.begin();
  scan_.add(contourOf(behind), 7);
  scan_.add(contourOf(front), 3);
  scan_.add(contourOf(across), 0);
  scan_.finish(scan);
  for (std::size_t i = 0; i < 360; ++i) {
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / 360.0;
    const double a = rayTo(front, bearing), b = rayTo(behind, bearing), c = rayTo(across, bearing);
    const double nearest = std::min({a, b, c});
    if (nearest > 2.4) {
      EXPECT_EQ(scan.label[i], RayLabel::kFloorEnd);
      continue;
    }
    EXPECT_EQ(scan.label[i], RayLabel::kUnknown);
    EXPECT_NEAR(scan.range_m[i], nearest, 1e-5);
    EXPECT_EQ(scan.object[i], nearest == a ? 3 : nearest == b ? 7 : 0);
    const double expected = (0.25 + nearest * nearest) / 0.5 / 148.66;
    EXPECT_NEAR(scan.sigma_m[i], expected, 0.05 * expected);
  }
  scan_.begin();  // nothing is left from the last frame
  scan_.finish(scan);
  EXPECT_EQ(scan.label[17], RayLabel::kFloorEnd);
}

TEST(FloorScan, MarksBearingsWithoutFloorInvalid) {
  auto model = testing::fisheyeModel();
  model.rotation_rpy_deg = {0.0, -60.0, 0.0};  // looks forward and down
  model.fov_deg = 90.0;
  model.self_mask_radius_px = 0.0;
  const lens::Camera camera(model);
  const ground::FloorView view(camera, {});
  FloorScan scanner(camera, view, {});
  Scan scan;
  scanner.begin();
  scanner.finish(scan);
  EXPECT_EQ(scan.label[0], RayLabel::kFloorEnd);
  EXPECT_EQ(scan.label[180], RayLabel::kInvalid);
}

TEST(FloorScan, RejectsCameraWithHardlyAnyFloorInView) {
  auto model = testing::fisheyeModel();
  model.focal_px = {1e9, 1e9};
  model.self_mask_radius_px = 0.0;
  const lens::Camera camera(model);
  const ground::FloorView view(camera, {});
  try {
    const FloorScan scanner(camera, view, {});
    FAIL() << "accepted";
  } catch (const options::Error& error) {
    EXPECT_NE(std::string(error.what()).find("focal_px"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace omnifleet::local_mapper
