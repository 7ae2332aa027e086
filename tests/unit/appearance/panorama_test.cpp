// Panoramas of images whose grey level is a closed-form function of the direction.

#include "appearance/panorama.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

namespace omnifleet::appearance {
namespace {

constexpr double kDegree = M_PI / 180.0;

/// Smooth over the whole sphere below and around the horizon.
double greyOf(double bearing, double elevation) {
  return 128.0 + 60.0 * std::sin(3.0 * bearing + 0.5) + 40.0 * std::cos(7.0 * bearing + 9.0 * elevation);
}

lens::CameraModel fisheye(double fov_deg = 185.0) {
  lens::CameraModel model;
  model.image_width_px = 1280;
  model.image_height_px = 960;
  model.principal_point_px = {641.3, 477.8};
  model.fov_deg = fov_deg;
  model.focal_px = Eigen::Vector2d::Constant(470.0 / (0.5 * fov_deg * kDegree));
  model.position_m = {0.03, 0.0, 0.4};
  return model;
}

/// Image of a camera in which every pixel shows greyOf() of its direction.
cv::Mat1b imageOf(const lens::Camera& camera) {
  cv::Mat1b image(camera.model().image_height_px, camera.model().image_width_px, std::uint8_t{0});
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const auto ray = camera.rayFromPixel({x, y});
      if (ray)
        image(y, x) =
            cv::saturate_cast<std::uint8_t>(greyOf(std::atan2(ray->y(), ray->x()), std::asin(ray->z())));
    }
  }
  return image;
}

/// Largest difference between valid cells and greyOf() at their centres.
double largestError(const Unwrapper& unwrapper, const cv::Mat1b& panorama) {
  double largest = 0.0;
  const double row_rad = (unwrapper.mostElevation_rad() - unwrapper.leastElevation_rad()) / panorama.rows;
  for (int row = 0; row < panorama.rows; ++row) {
    for (int column = 0; column < panorama.cols; ++column) {
      if (unwrapper.valid()(row, column) == 0) continue;
      const double truth =
          greyOf(2.0 * M_PI * column / panorama.cols, unwrapper.mostElevation_rad() - (row + 0.5) * row_rad);
      largest = std::max(largest, std::abs(truth - panorama(row, column)));
    }
  }
  return largest;
}

// Grey levels: the slope is at most 460 per radian, a pixel at the rim 0.0021 rad; samples are rounded to
// whole pixels and cells are means of few of them.
constexpr double kTolerance = 2.5;

TEST(Panorama, ShowsDirectionsOfDownwardFisheye) {
  const lens::Camera camera(fisheye());
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, {});
  cv::Mat1b panorama;
  unwrapper.unwrap(imageOf(camera), panorama);
  EXPECT_EQ(panorama.size(), cv::Size(512, 64));
  EXPECT_EQ(cv::countNonZero(unwrapper.valid()), 64 * 512);
  EXPECT_LT(largestError(unwrapper, panorama), kTolerance);
  EXPECT_EQ(unwrapper.camera(), "equidistant 1280x960");
}

TEST(Panorama, ShowsDirectionsOfTiltedAndTurnedFisheye) {
  lens::CameraModel model = fisheye(200.0);
  model.rotation_rpy_deg = {4.0, -3.0, 140.0};
  const lens::Camera camera(model);
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, {});
  cv::Mat1b panorama;
  unwrapper.unwrap(imageOf(camera), panorama);
  EXPECT_GT(cv::countNonZero(unwrapper.valid()), 62 * 512);
  EXPECT_LT(largestError(unwrapper, panorama), kTolerance);
}

TEST(Panorama, MovesBandBelowRimOfNarrowLens) {
  const lens::Camera camera(fisheye(175.0));
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, {});
  EXPECT_LT(unwrapper.mostElevation_rad(), -2.5 * kDegree);
  EXPECT_GT(unwrapper.mostElevation_rad(), -4.0 * kDegree);
  EXPECT_NEAR(unwrapper.mostElevation_rad() - unwrapper.leastElevation_rad(), 14.5 * kDegree, 1e-9);
  EXPECT_EQ(cv::countNonZero(unwrapper.valid()), 64 * 512);
}

TEST(Panorama, InterpolatesBearingsHiddenByOwnBody) {
  const lens::Camera camera(fisheye());
  PanoramaOptions options;
  options.hidden_deg = {350.0, 10.0};
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, options);
  EXPECT_EQ(unwrapper.valid()(20, 0), 0);
  EXPECT_EQ(unwrapper.valid()(20, 13), 0);
  EXPECT_EQ(unwrapper.valid()(20, 500), 0);
  EXPECT_EQ(unwrapper.valid()(20, 15), 255);
  EXPECT_EQ(unwrapper.valid()(20, 496), 255);
  cv::Mat1b panorama;
  unwrapper.unwrap(imageOf(camera), panorama);
  // The middle of the gap is the mean of its two ends, up to rounding.
  const int begin = 497, end = 15;  // columns beside the gap
  EXPECT_NEAR(panorama(20, 0), 0.5 * (panorama(20, begin) + panorama(20, end)), 4.0);
  EXPECT_LT(largestError(unwrapper, panorama), kTolerance);
}

TEST(Panorama, UnwrapsRingOfCatadioptricCamera) {
  PanoramaOptions options;
  options.rows = 32;
  options.columns = 256;
  const Ring ring{{400.5, 299.0}, 60.0, 250.0, 30.0, true, true};
  const Unwrapper unwrapper = Unwrapper::fromRing({800, 600}, ring, options);
  cv::Mat1b image(600, 800);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double bearing = -(std::atan2(y - 299.0, x - 400.5) - 30.0 * kDegree),
                   share = (std::hypot(y - 299.0, x - 400.5) - 60.0) / 190.0;
      image(y, x) = cv::saturate_cast<std::uint8_t>(
          greyOf(bearing, unwrapper.leastElevation_rad() +
                              share * (unwrapper.mostElevation_rad() - unwrapper.leastElevation_rad())));
    }
  }
  cv::Mat1b panorama;
  unwrapper.unwrap(image, panorama);
  // At the inner circle a pixel spans 0.017 rad, so the rounding of samples costs up to 4 grey levels.
  EXPECT_LT(largestError(unwrapper, panorama), 5.0);
  EXPECT_EQ(unwrapper.camera(), "ring 800x600");
}

TEST(Panorama, TakesEquirectangularImage) {
  PanoramaOptions options;
  options.least_elevation_deg = -30.0;
  options.most_elevation_deg = 20.0;
  cv::Mat1b image(1024, 2048);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      image(y, x) = cv::saturate_cast<std::uint8_t>(
          greyOf(2.0 * M_PI * (0.5 - (x + 0.5) / image.cols), M_PI * (0.5 - (y + 0.5) / image.rows)));
  }
  const Unwrapper unwrapper = Unwrapper::fromEquirectangular(image.size(), options);
  cv::Mat1b panorama;
  unwrapper.unwrap(image, panorama);
  EXPECT_LT(largestError(unwrapper, panorama), kTolerance);
}

TEST(Panorama, ConvertsColourAsOpenCv) {
  const lens::Camera camera(fisheye());
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, {});
  cv::Mat3b colours(960, 1280);
  cv::randu(colours, 0, 256);
  cv::blur(colours, colours, {9, 9});
  cv::Mat grey;
  cv::cvtColor(colours, grey, cv::COLOR_BGR2GRAY);
  cv::Mat1b of_colours, of_grey;
  unwrapper.unwrap(colours, of_colours);
  unwrapper.unwrap(grey, of_grey);
  EXPECT_LE(cv::norm(of_colours, of_grey, cv::NORM_INF), 1.0);  // both round
}

TEST(Panorama, AllocatesOnFirstCallOnly) {
  const lens::Camera camera(fisheye());
  const Unwrapper unwrapper = Unwrapper::fromCamera(camera, {});
  const cv::Mat1b image = imageOf(camera);
  cv::Mat1b panorama;
  unwrapper.unwrap(image, panorama);
  const std::uint8_t* const data = panorama.data;
  unwrapper.unwrap(image, panorama);
  EXPECT_EQ(panorama.data, data);
}

TEST(Panorama, RefusesOtherImages) {
  const Unwrapper unwrapper = Unwrapper::fromCamera(lens::Camera(fisheye()), {});
  cv::Mat1b panorama;
  try {
    unwrapper.unwrap(cv::Mat1b(480, 640), panorama);
    FAIL() << "an image of another size must be refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("640x480"));
    EXPECT_THAT(error.what(), testing::HasSubstr("equidistant 1280x960"));
  }
  EXPECT_THROW(unwrapper.unwrap(cv::Mat(960, 1280, CV_16UC1), panorama), std::invalid_argument);
  EXPECT_THROW(unwrapper.unwrap(cv::Mat(), panorama), std::invalid_argument);
}

TEST(Panorama, RefusesBandThatCameraCannotSee) {
  PanoramaOptions options;
  options.least_elevation_deg = 40.0;
  options.most_elevation_deg = 60.0;
  EXPECT_THROW(Unwrapper::fromRing({640, 480}, {{320, 240}, 200.0, 100.0}, options), options::Error);
  lens::CameraModel model = fisheye();
  model.self_mask_radius_px = 2000.0;
  EXPECT_THROW(Unwrapper::fromCamera(lens::Camera(model), options), options::Error);
}

TEST(Panorama, OptionsNameKeyAndBound) {
  try {
    PanoramaOptions::read(options::Section::parse("hidden_deg: [10]", "test.yaml"));
    FAIL() << "one bearing is no sector";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("test.yaml:1: hidden_deg"));
  }
}

}  // namespace
}  // namespace omnifleet::appearance
