// Each format against the program that defines it: OpenCV's own projection, OCamCalib's own formulas.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/persistence.hpp>

#include "tests/unit/lens/foreign_for_tests.h"
#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

using ::testing::HasSubstr;

const cv::Matx33d kSkewed(230, 4, 480, 0, 231, 300, 0, 0, 1);

std::vector<cv::Point3d> pointsUpTo(double last_deg) {
  std::vector<cv::Point3d> points;
  for (double theta = 1.0; theta <= last_deg; theta += 3.1) {
    for (int k = 0; k < 8; ++k) {
      const Eigen::Vector3d r = rayAt(theta * kDeg, 0.3 + k * M_PI / 4.0);
      points.emplace_back(r.x(), r.y(), r.z());
    }
  }
  return points;
}

void expectPixels(const CameraModel& model, const std::vector<cv::Point3d>& points,
                  const std::vector<cv::Point2d>& pixels) {
  const auto lens = Lens::make(model);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d ray(points[i].x, points[i].y, points[i].z);
    const auto pixel = lens->pixelFromRay(ray);
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x(), pixels[i].x, 1e-8);  // the same formulas in another order: rounding only
    EXPECT_NEAR(pixel->y(), pixels[i].y, 1e-8);
    const auto back = lens->rayFromPixel(*pixel);
    ASSERT_TRUE(back);
    EXPECT_LT((*back - ray.normalized()).norm(), 1e-11);
  }
}

/// A file that OpenCV itself writes: XML, YAML or JSON by the extension.
void writeOpenCv(const std::string& path, const cv::Matx33d& k, const std::vector<double>& d, int fisheye) {
  cv::FileStorage file(path, cv::FileStorage::WRITE);
  file << "calibration_time"
       << "Sun Mar  1 10:00:00 2026"
       << "nr_of_frames" << 25 << "image_width" << 960 << "image_height" << 600 << "board_width" << 9
       << "board_height" << 6 << "square_size" << 0.025;
  file << "flags" << 10 << "fisheye_model" << fisheye;
  file << "camera_matrix" << cv::Mat(k) << "distortion_coefficients" << cv::Mat(d, true);
  file << "avg_reprojection_error" << 0.31 << "per_view_reprojection_errors" << cv::Mat::ones(25, 1, CV_32F)
       << "extrinsic_parameters" << cv::Mat::zeros(25, 6, CV_64F);
}

TEST(OpenCvCalibration, ProjectsAsFisheyeWithSkewFromEachSyntax) {
  const omnifleet::test::TempFolder folder;
  const std::vector<double> d{0.013, 0.003, -0.006, 0.001};
  const std::vector<cv::Point3d> points = pointsUpTo(85.0);
  std::vector<cv::Point2d> pixels;
  cv::fisheye::projectPoints(points, pixels, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), kSkewed,
                             cv::Vec4d(d.data()), kSkewed(0, 1) / kSkewed(0, 0));
  for (const char* name : {"c.xml", "c.yml", "c.json"}) {
    SCOPED_TRACE(name);
    writeOpenCv(folder / name, kSkewed, d, 1);
    const Loaded loaded =
        loadText(folder, fmt::format("calibration: {}\nposition_m: [0, 0, 0.5]\n", name), "");
    ASSERT_EQ(loaded.refusal, "");
    EXPECT_EQ(loaded.model.skew_px, 4.0);
    expectPixels(loaded.model, points, pixels);
    const Loaded again = loadText(folder, loaded.model.toYaml(), "");
    ASSERT_EQ(again.refusal, "");
    expectPixels(again.model, points, pixels);
  }
}

TEST(OpenCvCalibration, ProjectsAsPinholeWithEachNumberOfCoefficients) {
  const omnifleet::test::TempFolder folder;
  const cv::Matx33d k(820, 0, 480, 0, 815, 300, 0, 0, 1);
  const std::vector<cv::Point3d> points = pointsUpTo(30.0);
  for (const std::vector<double>& d :
       {std::vector<double>{-0.28, 0.09, 0.001, -0.0007},
        std::vector<double>{-0.28, 0.09, 0.001, -0.0007, -0.012},
        std::vector<double>{0.1, -0.05, 0.0003, 0.0002, 0.01, 0.12, -0.02, 0.004},
        std::vector<double>{0.1, -0.05, 0.0003, 0.0002, 0.01, 0.12, -0.02, 0.004, 0, 0, 0, 0, 0, 0}}) {
    SCOPED_TRACE(d.size());
    writeOpenCv(folder / "c.xml", k, d, 0);
    const Loaded loaded = loadText(folder, "calibration: c.xml\nposition_m: [0, 0, 0.5]\n", "");
    ASSERT_EQ(loaded.refusal, "");
    std::vector<cv::Point2d> pixels;
    cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), k, d, pixels);
    expectPixels(loaded.model, points, pixels);
  }
  writeOpenCv(folder / "c.xml", k, {0.1, 0, 0, 0, 0, 0, 0, 0, 0.001, 0, 0, 0}, 0);
  EXPECT_THAT(loadText(folder, "calibration: c.xml\n", "").refusal, HasSubstr("thin prism"));
}

/// u = fx·x + s·y + cx after the distortion, as MATLAB and others define it; cv::projectPoints ignores
/// K[0][1].
TEST(OpenCvCalibration, AddsSkewToPinhole) {
  const omnifleet::test::TempFolder folder;
  const std::vector<double> d{-0.28, 0.09, 0.001, -0.0007, -0.012};
  const std::vector<cv::Point3d> points = pointsUpTo(25.0);
  std::vector<cv::Point2d> normalized, pixels;
  cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), cv::Matx33d::eye(), d, normalized);
  for (const auto& p : normalized) pixels.emplace_back(820 * p.x + 5 * p.y + 480, 815 * p.y + 300);
  writeOpenCv(folder / "c.yml", {820, 5, 480, 0, 815, 300, 0, 0, 1}, d, 0);
  const Loaded loaded = loadText(folder, "calibration: c.yml\nposition_m: [0, 0, 0.5]\n", "");
  ASSERT_EQ(loaded.refusal, "");
  expectPixels(loaded.model, points, pixels);
}

TEST(OpenCvCalibration, ReadsAlphaAsSkew) {
  const omnifleet::test::TempFolder folder;
  const std::string file =
      "image_size: [960, 600]\nfisheye_model: 1\nK: [[230, 0, 480], [0, 231, 300], [0, 0, 1]]\n"
      "D: [0.013, 0.003, -0.006, 0.001]\nalpha: 0.01\n";
  EXPECT_DOUBLE_EQ(loadText(folder, "calibration: cal.yml\n", file).model.skew_px, 2.3);
  EXPECT_THAT(loadText(folder,
                       "projection: ocam\nskew_px: 2\nimage_width: 640\nimage_height: 480\n"
                       "principal_point_px: [320, 240]\ndistortion: [-200, 0, 1e-3, 1, 0, 0]\n",
                       "")
                  .refusal,
              HasSubstr("skew_px"))
      << "ocam has an affine part of its own";
}

TEST(RosCameraInfo, ReadsMessageAsDumpedByRostopic) {
  const omnifleet::test::TempFolder folder;
  const std::string message =
      "header:\n  seq: 1\n  frame_id: cam\nheight: 600\nwidth: 960\ndistortion_model: rational_polynomial\n"
      "D: [0.1, -0.05, 0.0003, 0.0002, 0.01, 0.12, -0.02, 0.004]\n"
      "K: [820.0, 0.0, 480.0, 0.0, 815.0, 300.0, 0.0, 0.0, 1.0]\n"
      "R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
      "P: [800.0, 0.0, 470.0, 0.0, 0.0, 800.0, 310.0, 0.0, 0.0, 0.0, 1.0, 0.0]\n"
      "binning_x: 0\nbinning_y: 0\nroi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: False}\n";
  const Loaded loaded = loadText(folder, "calibration: cal.yml\n", message);
  ASSERT_EQ(loaded.refusal, "");
  EXPECT_EQ(loaded.model.kind, CameraKind::kPinhole);
  EXPECT_EQ(loaded.model.focal_px, Eigen::Vector2d(820, 815)) << "K, not P: the images are raw";
  EXPECT_EQ(loaded.model.distortion.size(), 8u);
  std::string cut = message;
  cut.replace(cut.find("binning_x: 0"), 12, "binning_x: 2");
  EXPECT_THAT(loadText(folder, "calibration: cal.yml\n", cut).refusal, HasSubstr("binned"));
}

TEST(KalibrCamchain, ReadsSecondCameraAndRadtan) {
  const omnifleet::test::TempFolder folder;
  const std::string chain =
      "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.01, 0, 0, 0]\n  distortion_model: "
      "equidistant\n"
      "  intrinsics: [230, 230, 480, 300]\n  resolution: [960, 600]\n  rostopic: /a\n  cam_overlaps: [1]\n"
      "cam1:\n  T_cn_cnm1:\n  - [1, 0, 0, 0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n"
      "  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]\n  distortion_model: "
      "radtan\n"
      "  intrinsics: [458.6, 457.3, 367.2, 248.4]\n  resolution: [752, 480]\n  timeshift_cam_imu: 0.01\n";
  const Loaded loaded = loadText(folder, "calibration: cal.yml\ncamera: cam1\n", chain);
  ASSERT_EQ(loaded.refusal, "");
  EXPECT_EQ(loaded.model.projection, Projection::kPinhole);
  EXPECT_EQ(loaded.model.image_width_px, 752);
  EXPECT_THAT(loaded.model.distortion, ::testing::ElementsAre(-0.28, 0.07, 0.0002, 1.8e-05));
}

TEST(KalibrCamchain, ReadsSensorYamlOfEuroc) {
  const omnifleet::test::TempFolder folder;
  const Loaded loaded =
      loadText(folder, "calibration: cal.yml\n",
               "sensor_type: camera\ncomment: VI-Sensor cam0\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, "
               "0, 0, 1, 0, 0, "
               "0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
               "intrinsics: [458.654, 457.296, 367.215, 248.375]\ndistortion_model: radial-tangential\n"
               "distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]\n");
  ASSERT_EQ(loaded.refusal, "");
  EXPECT_EQ(loaded.model.kind, CameraKind::kPinhole);
  EXPECT_EQ(loaded.model.focal_px, Eigen::Vector2d(458.654, 457.296));
}

/// calib_results.txt of the camera of models_for_tests.h. The inverse polynomial is fitted here by least
/// squares, as OCamCalib does.
std::string calibResults(const CameraModel& m) {
  const std::vector<double>& k = m.distortion;
  constexpr int kTerms = 12;
  cv::Mat1d a(400, kTerms), b(400, 1);
  for (int i = 0; i < 400; ++i) {
    const double rho = 2.4 * (i + 1);
    double z = 0.0;
    for (int j = 4; j >= 0; --j) z = z * rho + k[static_cast<std::size_t>(j)];
    const double theta = std::atan2(z, rho);
    for (int j = 0; j < kTerms; ++j) a(i, j) = std::pow(theta, j);
    b(i, 0) = rho;
  }
  cv::Mat1d x;
  cv::solve(a, b, x, cv::DECOMP_SVD);
  std::string text =
      "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). These are used by "
      "cam2world\n\n5";
  for (std::size_t i = 0; i < 5; ++i) text += fmt::format(" {:e}", k[i]);
  text += " \n\n#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB).\n\n";
  text += fmt::format("{}", kTerms);
  for (int j = 0; j < kTerms; ++j) text += fmt::format(" {:.9e}", x(j, 0));
  text += fmt::format("\n\n#center: \"row\" and \"column\", starting from 0 (C convention)\n\n{} {}\n\n",
                      m.principal_point_px.y(), m.principal_point_px.x());
  text += fmt::format("#affine parameters \"c\", \"d\", \"e\"\n\n{} {} {}\n\n", k[5], k[6], k[7]);
  return text + fmt::format("#image size: \"height\" and \"width\"\n\n{} {}\n\n", m.image_height_px,
                            m.image_width_px);
}

TEST(OcamCalibResults, GivesLensOfItsPolynomial) {
  const omnifleet::test::TempFolder folder;
  CameraModel m = simulatedOcam();
  m.principal_point_px.x() -= 20.0;  // row and column differ
  const Loaded loaded =
      loadText(folder, "calibration: calib_results.txt\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n",
               calibResults(m), "calib_results.txt");
  ASSERT_EQ(loaded.refusal, "");
  EXPECT_EQ(loaded.model.projection, Projection::kOcam);
  const auto expected = Lens::make(m), lens = Lens::make(loaded.model);
  for (double theta = 0.0; theta < 92.0; theta += 7.0) {
    for (double azimuth = 0.0; azimuth < 6.0; azimuth += 0.7) {
      const Eigen::Vector3d ray = rayAt(theta * kDeg, azimuth);
      // The file has 7 significant digits.
      EXPECT_LT((*lens->pixelFromRay(ray) - *expected->pixelFromRay(ray)).norm(), 1e-3);
    }
  }
}

TEST(OcamCalibResults, RejectsPolynomialThatContradictsItsInverse) {
  const omnifleet::test::TempFolder folder;
  const std::string good = calibResults(simulatedOcam());
  std::string bad = good;
  bad.replace(bad.find("5.832700e-04"), 12, "5.832700e-03");
  const std::string sensor = "calibration: cal.txt\nposition_m: [0, 0, 0.5]\n";
  EXPECT_EQ(loadText(folder, sensor, good, "cal.txt").refusal, "");
  EXPECT_THAT(loadText(folder, sensor, bad, "cal.txt").refusal, HasSubstr("cal.txt: the inverse polynomial"));
  EXPECT_THAT(loadText(folder, "camera_model: pinhole\n" + sensor, good, "cal.txt").refusal,
              HasSubstr("camera_model: contradicts"));
}

struct Senseless {
  const char* name;
  std::string text, refused;
};

/// Lenses that can be computed, but make no sense for their image.
TEST(Plausibility, RejectsLensThatMakesNoSense) {
  const std::string image = "image_width: 640\nimage_height: 480\n",
                    centre = "principal_point_px: [319.5, 239.5]\n";
  const std::string fisheye = "projection: equidistant\n" + image;
  for (const Senseless& row : std::vector<Senseless>{
           {"FocalLengthInMillimetres", fisheye + centre + "focal_px: 1.8\nfov_deg: 180\n",
            "not in millimetres"},
           {"FocalLengthOfOtherUnit", fisheye + centre + "focal_px: 148000\n", "degrees|in pixels"},
           {"CentreOutsideImage", fisheye + "focal_px: 150\nprincipal_point_px: [1200, 239.5]\n",
            "principal_point_px: (1200"},
           {"FocalLengthsUnlike", fisheye + centre + "focal_px: [150, 15]\n", "factor of 3"},
           {"PolynomialEndsInsideImage",
            "projection: kannala_brandt\n" + image + centre + "focal_px: 150\ndistortion: [-0.4, 0, 0, 0]\n",
            "cannot be inverted beyond 52.3"},
           {"PinholeAsKannalaBrandt",
            "projection: kannala_brandt\n" + image + centre +
                "focal_px: 400\ndistortion: [-1.3, 0.2, 0, 0]\n",
            "distortion"},
           {"SkewOfCentre", fisheye + centre + "focal_px: 150\nskew_px: 320\n", "skew_px"},
           {"OcamRowBeforeColumn",
            "projection: ocam\n" + image +
                "principal_point_px: [241, 318]\ndistortion: [-200, 0, 1e-3, 0, 0, 1, 0, 0]\n",
            "column and row"}}) {
    SCOPED_TRACE(row.name);
    const omnifleet::test::TempFolder folder;
    const Loaded loaded = loadText(folder, row.text + "position_m: [0, 0, 0.5]\n", "");
    EXPECT_THAT(loaded.refusal, HasSubstr("sensor.yaml"));
    EXPECT_THAT(loaded.refusal,
                ::testing::ContainsRegex(row.refused.find('(') == std::string::npos ? row.refused
                                                                                    : "principal_point_px"));
  }
}

TEST(Plausibility, AcceptsSmallCirclesAndStatedFields) {
  const std::string head =
      "image_width: 640\nimage_height: 480\nprincipal_point_px: [319.5, 239.5]\nposition_m: [0, 0, 0.5]\n";
  for (const char* lens :
       {"projection: equidistant\nfocal_px: 60\nfov_deg: 185\n",  // a circle of 97 px
        "projection: kannala_brandt\nfocal_px: 150\nfov_deg: 100\ndistortion: [-0.4, 0, 0, 0]\n",
        "projection: orthographic\nfocal_px: 230\nfov_deg: 185\n",
        "camera_model: pinhole\nfocal_px: 4000\n"}) {
    SCOPED_TRACE(lens);
    const omnifleet::test::TempFolder folder;
    EXPECT_EQ(loadText(folder, head + lens, "").refusal, "");
  }
}

}  // namespace
}  // namespace omnifleet::lens::test
