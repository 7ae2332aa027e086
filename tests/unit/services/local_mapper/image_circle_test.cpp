// The edge of a round image, painted where it must be found.

#include "local_mapper/image_circle.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace omnifleet::local_mapper {
namespace {

lens::CameraModel fisheye(double focal_px = 100.0) {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kFisheye;
  model.projection = lens::Projection::kEquidistant;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {focal_px, focal_px};
  model.principal_point_px = {322.0, 238.0};
  model.fov_deg = 180.0;
  return model;
}

/// A lit, noisy scene inside a circle about the principal point, `dark` outside.
cv::Mat round(double radius_px, double dark = 4.0, double lit = 120.0) {
  cv::Mat image(480, 640, CV_8UC3, cv::Scalar::all(dark));
  cv::Mat scene(480, 640, CV_8UC3, cv::Scalar::all(lit));
  cv::RNG random(7);
  cv::Mat noise(480, 640, CV_8UC3);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 6.0);
  cv::rectangle(scene, {100, 100}, {200, 260}, cv::Scalar(20, 40, 60), cv::FILLED);  // a dark box inside
  cv::Mat mask(480, 640, CV_8UC1, cv::Scalar(0));
  constexpr int kFractionBits = 4;
  cv::circle(mask, {322 << kFractionBits, 238 << kFractionBits},
             static_cast<int>(std::lround(radius_px * (1 << kFractionBits))), cv::Scalar(255), cv::FILLED,
             cv::LINE_8, kFractionBits);
  scene.copyTo(image, mask);
  image += noise;
  return image;
}

constexpr double kPi = 3.14159265358979;

TEST(ImageCircle, IsFoundWithinOnePixel) {
  for (const double radius : {120.0, 157.0, 215.0}) {
    const auto circle = findImageCircle(round(radius), {322.0, 238.0}, {});
    ASSERT_TRUE(circle) << radius;
    EXPECT_NEAR(circle->radius_px, radius, 1.0);
    EXPECT_LT(circle->sigma_px, 1.5);
    EXPECT_GT(circle->share, 0.95);
  }
}

TEST(ImageCircle, IsNotFoundWhereThereIsNone) {
  EXPECT_FALSE(findImageCircle(round(500.0), {322.0, 238.0}, {})) << "a lens that fills the sensor";
  EXPECT_FALSE(findImageCircle(round(157.0, 4.0, 10.0), {322.0, 238.0}, {})) << "a dark room";
  cv::Mat room(480, 640, CV_8UC3, cv::Scalar::all(5));  // lit in one irregular part
  const std::vector<cv::Point> part{{150, 40}, {500, 90}, {560, 300}, {330, 440}, {180, 400}};
  cv::fillConvexPoly(room, part, cv::Scalar::all(140));
  EXPECT_FALSE(findImageCircle(room, {322.0, 238.0}, {})) << "a lamp in a dark room";
}

TEST(LensContradiction, IsEmptyWhereTheImageEndsAsTheModelSays) {
  EXPECT_FALSE(contradiction(round(100.0 * kPi / 2), fisheye(), {}));
  EXPECT_FALSE(contradiction(round(96.0 * kPi / 2), fisheye(), {})) << "a soft edge";
  EXPECT_FALSE(contradiction(round(215.0), fisheye(), {})) << "the user gave a smaller field of view";
}

TEST(LensContradiction, NamesBothRadiiOfAWrongFocalLengthOrProjection) {
  const auto verdict = contradiction(round(80.0 * kPi / 2), fisheye(), {});
  ASSERT_TRUE(verdict);
  EXPECT_NEAR(verdict->seen.radius_px, 80.0 * kPi / 2, 1.0);
  EXPECT_NEAR(verdict->model_px, 100.0 * kPi / 2, 0.5);
  lens::CameraModel equisolid = fisheye();  // 2 f sin(45°) = 1.41 f instead of 1.57 f
  EXPECT_TRUE(contradiction(round(100.0 * std::sqrt(2.0)), equisolid, {}));
}

/// The commonest mistake: the file of a fisheye lens that is read as pinhole.
TEST(LensContradiction, KnowsThatAPinholeCameraHasNoRoundImage) {
  lens::CameraModel model = fisheye();
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  const auto verdict = contradiction(round(160.0), model, {});
  ASSERT_TRUE(verdict);
  EXPECT_EQ(verdict->model_px, 0.0);
  EXPECT_FALSE(contradiction(round(500.0), model, {}));
}

}  // namespace
}  // namespace omnifleet::local_mapper
