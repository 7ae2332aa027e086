#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

cv::Matx33d cameraMatrix(const CameraModel& m) {
  return {m.focal_px.x(), 0, m.principal_point_px.x(), 0, m.focal_px.y(), m.principal_point_px.y(), 0, 0, 1};
}

std::vector<cv::Point3d> rays(double last_deg) {
  std::vector<cv::Point3d> points;
  for (double theta = 0.5; theta <= last_deg; theta += 1.7) {
    for (int k = 0; k < 12; ++k) {
      const Eigen::Vector3d r = rayAt(theta * kDeg, 0.2 + k * M_PI / 6.0);
      points.emplace_back(r.x(), r.y(), r.z());
    }
  }
  return points;
}

void expectSame(const CameraModel& m, const std::vector<cv::Point3d>& points,
                const std::vector<cv::Point2d>& pixels) {
  const auto lens = Lens::make(m);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto pixel = lens->pixelFromRay({points[i].x, points[i].y, points[i].z});
    ASSERT_TRUE(pixel);
    // Same formulas in another order of operations: rounding only.
    EXPECT_NEAR(pixel->x(), pixels[i].x, 1e-8);
    EXPECT_NEAR(pixel->y(), pixels[i].y, 1e-8);
    const auto ray = lens->rayFromPixel({pixels[i].x, pixels[i].y});
    ASSERT_TRUE(ray);
    EXPECT_LT((*ray - Eigen::Vector3d(points[i].x, points[i].y, points[i].z)).norm(), 1e-11);
  }
}

// OpenCV's model divides by z, so it is a reference only below 90°.
TEST(AgainstOpenCv, MatchesFisheyeProjectPoints) {
  const CameraModel m = simulatedKannalaBrandt();
  const std::vector<cv::Point3d> points = rays(89.0);
  std::vector<cv::Point2d> pixels;
  const cv::Vec4d k(m.distortion[0], m.distortion[1], m.distortion[2], m.distortion[3]);
  cv::fisheye::projectPoints(points, pixels, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), cameraMatrix(m), k);
  expectSame(m, points, pixels);
}

TEST(AgainstOpenCv, MatchesProjectPoints) {
  for (const std::vector<double>& d :
       {std::vector<double>{}, std::vector<double>{-0.28, 0.09, 0.001, -0.0007},
        std::vector<double>{-0.28, 0.09, 0.001, -0.0007, -0.012},
        std::vector<double>{0.1, -0.05, 0.0003, 0.0002, 0.01, 0.12, -0.02, 0.004}}) {
    const CameraModel m = pinhole(d);
    const std::vector<cv::Point3d> points = rays(40.0);
    std::vector<cv::Point2d> pixels;
    cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), cameraMatrix(m), d, pixels);
    expectSame(m, points, pixels);
  }
}

// Two independent calibrations of one simulated camera with different tools and models (Kannala–Brandt RMS
// 0.28 px). They agree where both saw the chessboard. 1-based centres would shift the whole image by 1.4 px.
TEST(AgainstOtherCalibration, AgreesBetweenOcamAndKannalaBrandt) {
  const auto ocam = Lens::make(simulatedOcam(140.0)), kannala = Lens::make(simulatedKannalaBrandt(140.0));
  double sum = 0.0, most = 0.0;
  int n = 0;
  for (double theta = 0.0; theta <= 70.0; theta += 1.0) {
    for (int k = 0; k < 36; ++k, ++n) {
      const Eigen::Vector3d ray = rayAt(theta * kDeg, k * 10.0 * kDeg);
      const double d = (*ocam->pixelFromRay(ray) - *kannala->pixelFromRay(ray)).norm();
      sum += d;
      most = std::max(most, d);
    }
  }
  EXPECT_LT(sum / n, 0.5);
  EXPECT_LT(most, 1.2);
}

// cam2world of OCamCalib in its own frame (x down, y right, z backward; 1-based centre), written out.
TEST(AgainstOtherCalibration, MatchesPublishedOcamFormula) {
  const CameraModel m = simulatedOcam();
  const std::vector<double>& d = m.distortion;
  const auto lens = Lens::make(m);
  for (double row = 61.0; row < 1900.0; row += 91.0) {
    for (double column = 101.0; column < 1900.0; column += 83.0) {
      const double a = row + 1.0 - 960.6058, b = column + 1.0 - 960.5975;  // MATLAB indices are 1-based
      const double determinant = d[5] - d[6] * d[7];
      const double x = (a - d[6] * b) / determinant, y = (-d[7] * a + d[5] * b) / determinant;
      const double rho = std::hypot(x, y);
      const double z =
          d[0] + d[1] * rho + d[2] * rho * rho + d[3] * std::pow(rho, 3) + d[4] * std::pow(rho, 4);
      const Eigen::Vector3d expected = Eigen::Vector3d(y, x, -z).normalized();
      if (std::acos(expected.z()) > 92.4 * kDeg) continue;
      const auto ray = lens->rayFromPixel({column, row});
      ASSERT_TRUE(ray);
      EXPECT_LT((*ray - expected).norm(), 1e-12);
    }
  }
}

}  // namespace
}  // namespace omnifleet::lens::test
