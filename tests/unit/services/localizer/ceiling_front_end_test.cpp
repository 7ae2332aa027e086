#include "localizer/ceiling_front_end.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::localizer {
namespace {

dataset::MarkerSet markerSet() {
  dataset::MarkerSet set;
  set.height_m = 0.3;
  set.team = {20, 90, 220};
  set.team_offset_m = {-0.06, 0.0};
  set.individual_offset_m = {0.06, 0.0};
  set.patch_size_m = {0.09, 0.12};
  set.robots["r1"].individual = {230, 60, 60};
  set.robots["r2"].individual = {60, 200, 60};
  return set;
}

lens::CameraModel overhead() {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {410.0, 410.0};
  model.principal_point_px = {319.5, 239.5};
  model.position_m = {0.5, -0.2, 3.0};
  return model;
}

/// Paints a robot's two patches with OpenCV (eight-fold oversampling), through the camera's projection.
void paint(cv::Mat& image, const lens::Camera& camera, const dataset::MarkerSet& set,
           const std::string& robot, const Pose2& pose) {
  constexpr int kFold = 8;
  cv::Mat large;
  cv::resize(image, large, {}, kFold, kFold, cv::INTER_NEAREST);
  const auto fill = [&](const Eigen::Vector2d& offset, const dataset::Rgb& rgb, const Eigen::Vector2d& half) {
    std::vector<cv::Point> corners;
    for (const auto& c : {Eigen::Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
      const Eigen::Vector2d p = pose * (offset + c.cwiseProduct(half));
      const Eigen::Vector2d pixel = *camera.pixelFromPoint({p.x(), p.y(), set.height_m});
      // From the centre of a pixel to the fine grid, in 1/16 of a fine pixel.
      const auto fine = [](double v) {
        return static_cast<int>(std::lround(((v + 0.5) * kFold - 0.5) * 16));
      };
      corners.emplace_back(fine(pixel.x()), fine(pixel.y()));
    }
    cv::fillConvexPoly(large, corners, cv::Scalar(rgb[2], rgb[1], rgb[0]), cv::LINE_AA, 4);
  };
  fill({0, 0}, {30, 30, 30}, {0.14, 0.1});
  fill(set.team_offset_m, set.team, 0.5 * set.patch_size_m);
  fill(set.individual_offset_m, set.robots.at(robot).individual, 0.5 * set.patch_size_m);
  cv::resize(large, image, image.size(), 0, 0, cv::INTER_AREA);
}

TEST(CeilingFrontEnd, MeasuresOneAbsolutePosePerRobot) {
  const lens::Camera camera(overhead());
  const auto set = markerSet();
  cv::Mat image(480, 640, CV_8UC3, cv::Scalar(150, 160, 165));
  const Pose2 first{0.9, 0.1, 2.2}, second{-0.2, -0.7, -0.6};
  paint(image, camera, set, "r1", first);
  paint(image, camera, set, "r2", second);
  CeilingFrontEnd front_end("c7", overhead(), set, {});
  const auto measurements = front_end.process(12345, 6, image);
  ASSERT_EQ(measurements.size(), 2U);
  EXPECT_EQ(front_end.detections().size(), 2U);
  const Pose2* truth[] = {&first, &second};
  for (std::size_t i = 0; i < 2; ++i) {
    const Measurement& m = measurements[i];
    EXPECT_EQ(m.source, "ceiling/c7");
    EXPECT_EQ(m.to, i == 0 ? "r1" : "r2");
    EXPECT_EQ(m.kind, MeasurementKind::kAbsolutePose);
    EXPECT_EQ(m.acquired_ns, 12345);
    EXPECT_EQ(m.sequence, 6U);
    const Pose2 e = truth[i]->inverse() * Pose2::fromVector(m.value);
    EXPECT_LT(e.translation().norm(), 0.001);  // on clean images ≤ 1 mm
    EXPECT_LT(std::abs(e.theta_rad), 0.0035);  // on clean images ≤ 0.2°
    EXPECT_GT(m.covariance.determinant(), 0.0);
  }
}

TEST(CeilingFrontEnd, RejectsImagesOfAnotherSize) {
  CeilingFrontEnd front_end("c1", overhead(), markerSet(), {});
  EXPECT_THROW(front_end.process(0, 0, cv::Mat(480, 320, CV_8UC3, cv::Scalar::all(0))), std::runtime_error);
  EXPECT_THROW(front_end.process(0, 0, cv::Mat(480, 640, CV_8UC1, cv::Scalar::all(0))), std::runtime_error);
  EXPECT_TRUE(front_end.process(0, 0, cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(0))).empty());
}

}  // namespace
}  // namespace omnifleet::localizer
