// The edge of a round image, painted where it must be found, and circles through points.

#include "local_mapper/image_circle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::local_mapper {
namespace {

const Eigen::Vector2d kCentre_px{322.0, 238.0};

/// A lit, noisy scene inside a circle, `dark` outside.
cv::Mat roundImage(double radius_px, double dark = 4.0, double lit = 120.0,
                   const Eigen::Vector2d& centre_px = kCentre_px) {
  cv::Mat image(480, 640, CV_8UC3, cv::Scalar::all(dark));
  cv::Mat scene(480, 640, CV_8UC3, cv::Scalar::all(lit));
  cv::RNG random(7);
  cv::Mat noise(480, 640, CV_8UC3);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 6.0);
  cv::rectangle(scene, {100, 100}, {200, 260}, cv::Scalar(4, 4, 4), cv::FILLED);  // a black box at the rim
  cv::Mat mask(480, 640, CV_8UC1, cv::Scalar(0));
  constexpr int kFractionBits = 4;
  const auto fixed = [](double value) { return static_cast<int>(std::lround(value * (1 << kFractionBits))); };
  cv::circle(mask, {fixed(centre_px.x()), fixed(centre_px.y())}, fixed(radius_px), cv::Scalar(255),
             cv::FILLED, cv::LINE_8, kFractionBits);
  scene.copyTo(image, mask);
  image += noise;
  return image;
}

std::vector<Eigen::Vector2d> noisyArc(cv::RNG& random, int outliers) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 100; ++i) {
    const double angle = M_PI * i / 100;  // half a circle
    double radius = 200.0 + random.gaussian(1.0);
    if (i % 10 < outliers / 10) radius -= 20.0 + 100.0 * (i % 7);  // dark objects at the rim
    points.emplace_back(300.0 + radius * std::cos(angle), 250.0 + radius * std::sin(angle));
  }
  return points;
}

TEST(ImageCircle, IsFoundWithinOnePixel) {
  for (const double radius : {130.0, 157.0, 215.0, 290.0}) {  // the last one is cut off at top and bottom
    for (const Eigen::Vector2d& centre : {kCentre_px, Eigen::Vector2d(300.5, 251.25)}) {
      const auto circle = findImageCircle(roundImage(radius, 4.0, 120.0, centre), {});
      ASSERT_TRUE(circle) << radius;
      EXPECT_NEAR(circle->radius_px, radius, 1.0);
      EXPECT_NEAR((circle->centre_px - centre).norm(), 0.0, 1.0) << radius;
      EXPECT_LT(circle->sigma_px, 1.5);
    }
  }
}

TEST(ImageCircle, IsNotFoundWhereThereIsNone) {
  EXPECT_FALSE(findImageCircle(roundImage(500.0), {})) << "a lens that fills the sensor";
  EXPECT_FALSE(findImageCircle(roundImage(157.0, 4.0, 10.0), {})) << "a dark room";
  cv::Mat room(480, 640, CV_8UC3, cv::Scalar::all(5));  // lit in one irregular part
  const std::vector<cv::Point> part{{150, 40}, {500, 90}, {560, 300}, {330, 440}, {180, 400}};
  cv::fillConvexPoly(room, part, cv::Scalar::all(140));
  EXPECT_FALSE(findImageCircle(room, {})) << "a lit part of a dark room";
  EXPECT_FALSE(findImageCircle(roundImage(60.0), {})) << "a small lit spot";
}

/// A lamp on the robot lights the floor in a circle about the camera. Its light ends without an edge.
TEST(ImageCircle, IsNotTheLightOfALamp) {
  cv::Mat lamp(480, 640, CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < lamp.rows; ++y)
    for (int x = 0; x < lamp.cols; ++x) {
      const double r = std::hypot(x - 322.0, y - 238.0) / 60.0;
      lamp.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(250.0 * std::exp(-0.5 * r * r));
    }
  EXPECT_FALSE(findImageCircle(lamp, {}));
}

TEST(FittedCircle, RejectsFortyPercentOutliers) {
  cv::RNG random(3);
  const auto circle = fitCircle(noisyArc(random, 40));
  ASSERT_TRUE(circle);
  EXPECT_NEAR((circle->centre_px - Eigen::Vector2d(300.0, 250.0)).norm(), 0.0, 1.0);
  EXPECT_NEAR(circle->radius_px, 200.0, 1.0);
  EXPECT_NEAR(circle->share, 0.6, 0.03);
}

/// The uncertainties are those of 400 repetitions with other noise, within 20 % (4 σ of a spread of 400).
TEST(FittedCircle, StatesItsUncertainty) {
  cv::RNG random(5);
  double centre = 0.0, radius = 0.0, stated_centre = 0.0, stated_radius = 0.0;
  constexpr int kRepetitions = 400;
  for (int i = 0; i < kRepetitions; ++i) {
    const auto circle = fitCircle(noisyArc(random, 0));
    ASSERT_TRUE(circle);
    centre += std::pow(circle->centre_px.y() - 250.0, 2) / kRepetitions;  // across the half circle
    radius += std::pow(circle->radius_px - 200.0, 2) / kRepetitions;
    stated_centre += circle->centre_sigma_px / kRepetitions;
    stated_radius += circle->radius_sigma_px / kRepetitions;
  }
  EXPECT_NEAR(stated_centre / std::sqrt(centre), 1.0, 0.2);
  EXPECT_NEAR(stated_radius / std::sqrt(radius), 1.0, 0.2);
}

TEST(FittedCircle, NeedsPointsThatDetermineIt) {
  std::vector<Eigen::Vector2d> line;
  for (int i = 0; i < 20; ++i) line.emplace_back(i, 2.0 * i);
  EXPECT_FALSE(fitCircle(line));
  EXPECT_FALSE(fitCircle({{0.0, 1.0}, {1.0, 0.0}, {0.0, -1.0}}));
}

}  // namespace
}  // namespace omnifleet::local_mapper
