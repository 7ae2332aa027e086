#include <gtest/gtest.h>

#include <cmath>

#include "ground/floor_view.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

TEST(FloorView, EndsAtHorizonAndRobotMask) {
  const auto model = testing::fisheye();
  const FloorView view(lens::Camera(model), ViewOptions{});
  const double f = model.focal_px.x();
  const auto at = [&](double r_px) { return view.mask()(240, static_cast<int>(std::lround(319.5 + r_px))); };
  EXPECT_EQ(at(model.self_mask_radius_px - 2.0), 0);
  EXPECT_EQ(at(model.self_mask_radius_px + 6.0), 255);
  const double rim =
      f * (90.0 - 2.0) * M_PI / 180.0;  // equidistant lens: r = f·θ, two degrees below the horizon
  EXPECT_EQ(at(rim - 4.0), 255);
  EXPECT_EQ(at(rim + 1.0), 0);
  EXPECT_TRUE(view.nearBorder(static_cast<float>(319.5 + rim - 2.0), 240.0f));
  EXPECT_FALSE(view.nearBorder(static_cast<float>(319.5 + rim - 12.0), 240.0f));
  EXPECT_TRUE(view.nearBorder(-5.0f, 1000.0f));
}

TEST(FloorView, ExtendsOnOneSideOfATiltedCamera) {
  auto model = testing::fisheye();
  model.rotation_rpy_deg = {0.0, -10.0, 0.0};  // the optical axis turns forward (up in the image)
  const FloorView view(lens::Camera(model), ViewOptions{});
  const int u = 320, top_px = static_cast<int>(239.5 - model.focal_px.x() * 84.0 * M_PI / 180.0);
  EXPECT_EQ(view.mask()(top_px, u), 0);  // would be floor 6° below the horizon without the tilt
  EXPECT_EQ(view.mask()(479 - top_px, u), 255);
}

TEST(FloorView, PlacesSeedsInRingRectangleOrAnnulus) {
  const auto model = testing::fisheye();
  ViewOptions options;
  const FloorView ring(lens::Camera(model), options);
  for (int y = 0; y < ring.cells().height; ++y) {
    for (int x = 0; x < ring.cells().width; ++x) {
      if (ring.seeds()(y, x) == 0) continue;
      const double r = std::hypot(4 * x + 1.5 - 319.5, 4 * y + 1.5 - 239.5);
      EXPECT_GE(r, model.self_mask_radius_px);
      EXPECT_LE(r, model.self_mask_radius_px + options.mask_margin_px + options.seed_ring_px);
    }
  }
  options.seed_rectangle_px = {400, 100, 40, 20};
  const FloorView box(lens::Camera(model), options);
  EXPECT_EQ(cv::countNonZero(box.seeds()), 10 * 5);
  options.seed_rectangle_px.clear();
  options.seed_annulus_px = {420, 120, 0, 10};
  const FloorView disc(lens::Camera(model), options);
  EXPECT_NEAR(cv::countNonZero(disc.seeds()) * 16.0, M_PI * 100.0, 64.0);  // within a few cells
}

TEST(FloorView, RejectsCamerasAndSeedsWithoutFloor) {
  auto upward = testing::fisheye();
  upward.rotation_rpy_deg = {180.0, 0.0, 0.0};
  upward.fov_deg = 150.0;
  EXPECT_THROW(FloorView(lens::Camera(upward), ViewOptions{}), options::Error);
  auto buried = testing::fisheye();
  buried.position_m.z() = 0.0;
  EXPECT_THROW(FloorView(lens::Camera(buried), ViewOptions{}), options::Error);
  ViewOptions nowhere;
  nowhere.seed_rectangle_px = {0, 0, 20, 20};  // outside the image circle
  EXPECT_THROW(FloorView(lens::Camera(testing::fisheye()), nowhere), options::Error);
  EXPECT_THROW(ViewOptions::read(options::Section::parse("seed_annulus_px: [1, 2, 3]", "t.yaml")),
               options::Error);
  EXPECT_THROW(ViewOptions::read(options::Section::parse("seed_rings_px: 3", "t.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::ground
