#include "lens/correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace omnifleet::lens {
namespace {

CameraModel downward(Projection projection, double focal_px, double fov_deg) {
  CameraModel model;
  model.projection = projection;
  model.image_width_px = 1280;
  model.image_height_px = 960;
  model.focal_px = {focal_px, focal_px};
  model.principal_point_px = {639.5, 479.5};
  model.fov_deg = fov_deg;
  model.position_m = {0.0, 0.0, 0.5};
  return model;
}

CorrectionOptions orthographic(double focal_px) {
  CorrectionOptions options;
  options.projection = "orthographic";
  options.focal_px = focal_px;
  return options;
}

TEST(Correction, UsesSensorProjectionByDefault) {
  const Camera sensor(downward(Projection::kEquidistant, 297.0, 185.0));
  const Camera same = correctionCamera(sensor, {});
  EXPECT_EQ(same.model().projection, Projection::kEquidistant);
  EXPECT_EQ(*same.floorFromPixel({800.0, 300.0}), *sensor.floorFromPixel({800.0, 300.0}));
}

TEST(Correction, MatchesEquations6And7ScaledByHeight) {
  const Camera sensor(downward(Projection::kEquidistant, 297.0, 185.0));
  const double f = 360.0, height_m = 0.5;
  const Camera camera = correctionCamera(sensor, orthographic(f));
  const std::vector<Eigen::Vector2d> pixels{{10.0, 0.0}, {-120.0, 80.0}, {0.0, 300.0}, {250.0, -258.0}};
  for (const Eigen::Vector2d& d : pixels) {
    const double l = f * f / std::sqrt(f * f - d.squaredNorm());  // eq. 7
    const Eigen::Vector2d corrected = d * l / f;                  // eq. 6
    // Image right is −y of the robot; image down is −x.
    const Eigen::Vector2d expected = height_m / f * Eigen::Vector2d(-corrected.y(), -corrected.x());
    const auto floor = camera.floorFromPixel(Eigen::Vector2d(639.5, 479.5) + d);
    ASSERT_TRUE(floor);
    EXPECT_LT((*floor - expected).norm(), 1e-9) << d.transpose();
  }
}

TEST(Correction, ReturnsNothingAtAndBeyondF) {
  const Camera camera =
      correctionCamera(Camera(downward(Projection::kEquidistant, 297.0, 185.0)), orthographic(360.0));
  EXPECT_TRUE(camera.floorFromPixel({639.5 + 359.9, 479.5}));
  EXPECT_FALSE(camera.floorFromPixel({639.5 + 360.0, 479.5}));
  EXPECT_FALSE(camera.floorFromPixel({639.5 + 400.0, 479.5}));
  EXPECT_LE(camera.model().fov_deg, 180.0);
}

TEST(Correction, RecoversFocalLengthOfOrthographicLens) {
  const Camera sensor(downward(Projection::kOrthographic, 470.0, 170.0));
  EXPECT_NEAR(fittedFocalPx(sensor, 1.5), 470.0, 0.01);  // ternary search, 40 steps on a bracket of 2 %
}

TEST(Correction, FitsBestFocalLengthWithResidualError) {
  const Camera sensor(downward(Projection::kEquidistant, 297.0, 185.0));
  const auto error = [&](double focal_px) {
    const Camera camera = correctionCamera(sensor, orthographic(focal_px));
    double sum = 0.0;
    for (double range = 0.05; range <= 1.5; range += 0.05) {
      const auto floor = camera.floorFromPixel(*sensor.pixelFromPoint({range, 0.0, 0.0}));
      sum += floor ? std::pow(floor->x() - range, 2) : 1.5 * 1.5;
    }
    return std::sqrt(sum / 30.0);
  };
  const double fitted = fittedFocalPx(sensor, 1.5);
  EXPECT_LT(error(fitted), error(297.0));           // F of the sensor's projection
  EXPECT_LT(error(fitted), error(297.0 * M_PI_2));  // F at the edge of the image circle
  EXPECT_LT(error(fitted), error(1.03 * fitted));
  EXPECT_LT(error(fitted), error(0.97 * fitted));
  EXPECT_GT(error(fitted), 0.05);  // a 185° lens is not orthographic: an error of centimetres remains
}

}  // namespace
}  // namespace omnifleet::lens
