#include "calibration/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "calibration/initial_guess.h"
#include "calibration/projection.h"
#include "tests/unit/calibration/boards_for_tests.h"

namespace omnifleet::calibration::test {
namespace {

using lens::Projection;

class Lenses : public ::testing::TestWithParam<Projection> {};

Request requestFor(const lens::CameraModel& m) {
  return {m.projection, m.image_width_px, m.image_height_px, m.fov_deg};
}

// Exact corners of a known lens, up to 92° from the axis: the calibration recovers its numbers. Only rounding
// and the solver's tolerance (1e-12 of the cost) remain. 1e-4 px is far below the noise of any image.
// Polynomials are compared by their values, not by their coefficients.
TEST_P(Lenses, RecoversKnownIntrinsics) {
  const Board board = Board::parse("7x5", 0.05);
  const lens::CameraModel truth = lensModel(GetParam());
  const auto true_lens = lens::Lens::make(truth);
  const bool narrow = GetParam() == Projection::kPinhole;
  std::vector<View> views;
  for (const auto& pose : placesOf(board, narrow ? 0.35 : 1.35, 16, 5)) {
    const View view = viewOf(*true_lens, board, pose);
    if (view.corners_px.size() == 35u) views.push_back(view);
  }
  ASSERT_GE(views.size(), 10u);
  const Calibration found = calibrate(views, board, requestFor(truth));
  const auto lens = lens::Lens::make(found.model);
  EXPECT_LT(reprojectionRms_px(*lens, board, views, found.camera_from_board), 1e-6);
  EXPECT_LT((found.model.principal_point_px - truth.principal_point_px).norm(), 1e-3);
  for (double theta = 0.0; theta < found.outermost_deg * M_PI / 180.0; theta += 0.02) {
    for (double azimuth = 0.0; azimuth < 6.28; azimuth += 0.5) {
      const Eigen::Vector3d ray(std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth),
                                std::cos(theta));
      const auto expected = true_lens->pixelFromRay(ray), here = lens->pixelFromRay(ray);
      if (!expected) continue;
      ASSERT_TRUE(here) << theta;
      EXPECT_LT((*here - *expected).norm(), 2e-3) << theta;
    }
  }
}

// The equations of the solver are those of libs/lens.
TEST_P(Lenses, MatchesProjectorAndLens) {
  const lens::CameraModel m = lensModel(GetParam());
  const auto lens = lens::Lens::make(m);
  std::array<double, kIntrinsics> p{m.focal_px.x(), m.focal_px.y(), m.principal_point_px.x(),
                                    m.principal_point_px.y()};
  std::copy(m.distortion.begin(), m.distortion.end() - (GetParam() == Projection::kOcam ? 3 : 0),
            p.begin() + 4);
  if (GetParam() == Projection::kOcam) {
    const std::vector<double>& d = m.distortion;
    const double s = kOcamScale_px;
    p = {d[5],     d[7],         m.principal_point_px.x(), m.principal_point_px.y(), d[6], d[0],
         d[2] * s, d[3] * s * s, d[4] * s * s * s};
  }
  int compared = 0;
  for (double theta = 0.0; theta < 1.6; theta += 0.05) {
    const Eigen::Vector3d ray(2.0 * std::sin(theta) * std::cos(1.1), 2.0 * std::sin(theta) * std::sin(1.1),
                              2.0 * std::cos(theta));
    const auto expected = lens->pixelFromRay(ray);
    if (!expected) continue;
    Eigen::Vector2d pixel;
    ASSERT_TRUE(Projector<double>(GetParam(), p.data()).project(ray.data(), pixel.data())) << theta;
    EXPECT_LT((pixel - *expected).norm(), 1e-7) << theta;
    ++compared;
  }
  EXPECT_GE(compared, 14);
}

INSTANTIATE_TEST_SUITE_P(All, Lenses,
                         ::testing::Values(Projection::kOrthographic, Projection::kEquidistant,
                                           Projection::kEquisolid, Projection::kStereographic,
                                           Projection::kKannalaBrandt, Projection::kOcam,
                                           Projection::kPinhole));

// Corners from OpenCV's own fisheye model, with K and D in its order: an independent reference.
TEST(Calibrate, RecoversFisheyeLensOfOpenCv) {
  const Board board = Board::parse("7x5", 0.05);
  const cv::Matx33d k(231.0, 0, 397.0, 0, 233.5, 322.0, 0, 0, 1);
  const cv::Vec4d d(0.03, -0.012, 0.006, -0.0015);
  std::vector<cv::Point3d> places;
  for (const auto& p : board.corners_m()) places.emplace_back(p.x(), p.y(), 0.0);
  std::vector<View> views;
  for (const auto& pose : placesOf(board, 1.0, 14, 9)) {
    const Eigen::AngleAxisd turn(pose.rotation());
    const Eigen::Vector3d r = turn.angle() * turn.axis(), t = pose.translation();
    std::vector<cv::Point2d> pixels;
    cv::fisheye::projectPoints(places, pixels, cv::Vec3d(r.x(), r.y(), r.z()), cv::Vec3d(t.x(), t.y(), t.z()),
                               k, d);
    views.push_back({"opencv", {}});
    for (const auto& pixel : pixels) views.back().corners_px.emplace_back(pixel.x, pixel.y);
  }
  const Calibration found = calibrate(views, board, {Projection::kKannalaBrandt, 800, 640, 0.0});
  EXPECT_NEAR(found.model.focal_px.x(), 231.0, 1e-3);
  EXPECT_NEAR(found.model.focal_px.y(), 233.5, 1e-3);
  EXPECT_NEAR(found.model.principal_point_px.x(), 397.0, 1e-3);
  EXPECT_NEAR(found.model.principal_point_px.y(), 322.0, 1e-3);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(found.model.distortion.at(i), d[i], 1e-4) << i;
}

TEST(Calibrate, EstimatesPoseFromRaysBeyondNinetyDegrees) {
  const Board board = Board::parse("6x4", 0.08);
  const Eigen::Isometry3d truth = boardAt(board, 1.55, 2.0, 0.6, {0.3, -0.2, 0.9});
  std::vector<Eigen::Vector3d> rays;
  int behind = 0;
  for (const auto& p : board.corners_m()) {
    rays.push_back((truth * Eigen::Vector3d(p.x(), p.y(), 0.0)).normalized());
    behind += rays.back().z() < 0.0;
  }
  ASSERT_GT(behind, 3);
  const Eigen::Isometry3d found = poseFromRays(board.corners_m(), rays);
  EXPECT_LT((found.matrix() - truth.matrix()).norm(), 1e-9);
}

TEST(Calibrate, RejectsFewerThanThreeViews) {
  const Board board = Board::parse("7x5", 0.05);
  const lens::CameraModel truth = lensModel(Projection::kEquidistant);
  const auto lens = lens::Lens::make(truth);
  std::vector<View> views;
  for (const auto& pose : placesOf(board, 0.9, 8, 3)) views.push_back(viewOf(*lens, board, pose));
  EXPECT_THROW(calibrate({views[0], views[1]}, board, requestFor(truth)), std::runtime_error);
}

// r = θ − 0.06 θ³ stops increasing at θ = √(1/0.18) = 135.05°. Such a lens supports 250°, not 290°.
TEST(Calibrate, RejectsFieldOfViewBeyondInvertibleRange) {
  const Board board = Board::parse("7x5", 0.05);
  lens::CameraModel truth = lensModel(Projection::kKannalaBrandt);
  truth.distortion = {-0.06, 0.0, 0.0, 0.0};
  const auto lens = lens::Lens::make(truth);
  std::vector<View> views;
  for (const auto& pose : placesOf(board, 1.2, 12, 3)) {
    const View view = viewOf(*lens, board, pose);
    if (view.corners_px.size() == 35u) views.push_back(view);
  }
  Request request = requestFor(truth);
  request.fov_deg = 250.0;
  EXPECT_EQ(calibrate(views, board, request).model.fov_deg, 250.0);
  request.fov_deg = 290.0;
  try {
    calibrate(views, board, request);
    ADD_FAILURE() << "accepted";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("cannot be inverted beyond 135.0"));
  }
}

}  // namespace
}  // namespace omnifleet::calibration::test
