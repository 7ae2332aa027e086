#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core/persistence.hpp>

#include "tests/test_data.h"
#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string written(const omnifleet::test::TempFolder& folder, const std::string& name,
                    const std::string& text) {
  std::ofstream(folder / name) << text;
  return folder / name;
}

std::string refusal(const std::string& path) {
  try {
    CameraModel::load(path);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "";
}

constexpr const char* kSensor =
    "camera_model: fisheye\nprojection: kannala_brandt\nimage_width: 640\nimage_height: 480\nfocal_px: "
    "[150.5, 151]\n"
    "principal_point_px: [319.5, 239.5]\nfov_deg: 185\ndistortion: [0.01, -0.002, 0, 0]\nposition_m: [0, "
    "0.1, 0.5]\n"
    "rotation_rpy_deg: [0.0, -90.0, 3]\nself_mask_radius_px: 99\n";

TEST(SensorYaml, ReadsAndWritesEveryKey) {
  const omnifleet::test::TempFolder folder;
  const CameraModel m = CameraModel::load(written(folder, "sensor.yaml", kSensor));
  EXPECT_EQ(m.kind, CameraKind::kFisheye);
  EXPECT_EQ(m.projection, Projection::kKannalaBrandt);
  EXPECT_EQ(m.image_width_px, 640);
  EXPECT_EQ(m.image_height_px, 480);
  EXPECT_EQ(m.focal_px, Eigen::Vector2d(150.5, 151.0));
  EXPECT_EQ(m.principal_point_px, Eigen::Vector2d(319.5, 239.5));
  EXPECT_EQ(m.fov_deg, 185.0);
  EXPECT_THAT(m.distortion, ::testing::ElementsAre(0.01, -0.002, 0.0, 0.0));
  EXPECT_EQ(m.position_m, Eigen::Vector3d(0.0, 0.1, 0.5));
  EXPECT_EQ(m.rotation_rpy_deg, Eigen::Vector3d(0.0, -90.0, 3.0));
  EXPECT_EQ(m.self_mask_radius_px, 99.0);
  const CameraModel again = CameraModel::load(written(folder, "again.yaml", m.toYaml()));
  EXPECT_EQ(again.toYaml(), m.toYaml());
  EXPECT_EQ(again.focal_px, m.focal_px);
  EXPECT_EQ(again.distortion, m.distortion);
}

TEST(SensorYaml, NamesFileLineKeyAndBoundInErrors) {
  const omnifleet::test::TempFolder folder;
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = kSensor;
    text.replace(text.find(from), from.size(), to);
    return refusal(written(folder, "s.yaml", text));
  };
  EXPECT_THAT(with("fov_deg: 185", "fov_deg: 400"),
              AllOf(HasSubstr("s.yaml:7: fov_deg"), HasSubstr("[1, 360]")));
  EXPECT_THAT(refusal(written(
                  folder, "s.yaml",
                  "camera_model: fisheye\nprojection: stereographic\nimage_width: 640\nimage_height: 480\n"
                  "focal_px: 100\nprincipal_point_px: [320, 240]\nfov_deg: 360\n")),
              AllOf(HasSubstr("s.yaml:7: fov_deg"), HasSubstr("180°")));
  EXPECT_THAT(with("focal_px: [150.5, 151]", "focal_px: 0"),
              AllOf(HasSubstr("s.yaml:5: focal_px"), HasSubstr("within [0.1, ")));
  EXPECT_THAT(with("focal_px: [150.5, 151]", "focal_px: 1e9"), HasSubstr("s.yaml:5: focal_px"));
  EXPECT_THAT(with("kannala_brandt", "perspektive"),
              AllOf(HasSubstr("s.yaml:2: projection"), HasSubstr("equisolid")));
  EXPECT_THAT(with("fov_deg", "fov"), AllOf(HasSubstr("s.yaml:7: fov"), HasSubstr("unknown key")));
  EXPECT_THAT(with("[0.01, -0.002, 0, 0]", "[-0.2, 0, 0, 0]"),
              AllOf(HasSubstr("s.yaml:8: distortion"), HasSubstr("beyond 73.9")));
  EXPECT_THAT(with("focal_px: [150.5, 151]\n", ""), HasSubstr("focal_px: is required"));
  EXPECT_THAT(with("640", ".nan"), HasSubstr("image_width"));
  EXPECT_THAT(refusal(folder / "nowhere.yaml"),
              AllOf(HasSubstr("nowhere.yaml"), HasSubstr("cannot be read")));
}

TEST(SensorYaml, FillsIntrinsicsOfPanorama) {
  const omnifleet::test::TempFolder folder;
  const CameraModel m = CameraModel::load(
      written(folder, "p.yaml", "camera_model: equirectangular\nimage_width: 1000\nimage_height: 500\n"));
  const auto lens = Lens::make(m);
  EXPECT_LT((*lens->pixelFromRay({0, 0, 1}) - Eigen::Vector2d(499.5, 249.5)).norm(), 1e-9);
  EXPECT_LT((*lens->pixelFromRay({1, 0, 0}) - Eigen::Vector2d(749.5, 249.5)).norm(), 1e-9);
}

TEST(OpenCvFile, ReadsPinholeAndFisheyeFromXmlAndYaml) {
  const omnifleet::test::TempFolder folder;
  for (const char* name : {"c.xml", "c.yml", "f.xml", "f.yml"}) {
    const bool fisheye = name[0] == 'f';
    {
      cv::FileStorage file(folder / name, cv::FileStorage::WRITE);
      file << "image_width" << 800 << "image_height" << 600;
      if (fisheye) file << "fisheye_model" << 1;
      file << "camera_matrix" << cv::Mat(cv::Matx33d(250, 0, 401, 0, 251, 299, 0, 0, 1));
      const cv::Mat distortion = fisheye ? cv::Mat(cv::Vec4d(0.01, -0.002, 0.001, 0.0))
                                         : cv::Mat((cv::Mat_<double>(1, 5) << -0.1, 0.02, 0.001, 0.002, 0.0));
      file << "distortion_coefficients" << distortion;
    }
    const CameraModel m = CameraModel::load(folder / name);
    EXPECT_EQ(m.projection, fisheye ? Projection::kKannalaBrandt : Projection::kPinhole) << name;
    EXPECT_EQ(m.focal_px, Eigen::Vector2d(250, 251));
    EXPECT_EQ(m.principal_point_px, Eigen::Vector2d(401, 299));
    EXPECT_EQ(m.distortion.size(), fisheye ? 4u : 5u);
    EXPECT_EQ(m.image_height_px, 600);
    if (!fisheye) continue;
    const auto corner = Lens::make(m)->rayFromPixel({0.0, 0.0});
    EXPECT_TRUE(corner) << "the field of view reaches the corners: " << m.fov_deg;
  }
}

TEST(OpenCvFile, AcceptsByteOrderMark) {
  const omnifleet::test::TempFolder folder;
  for (const char* name : {"c.xml", "c.yml"}) {
    cv::FileStorage file(name, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    file << "image_width" << 800 << "image_height" << 600 << "fisheye_model" << 0;
    file << "camera_matrix" << cv::Mat(cv::Matx33d(250, 0, 401, 0, 251, 299, 0, 0, 1));
    const std::string path = written(folder, name, "\xEF\xBB\xBF" + file.releaseAndGetString());
    EXPECT_EQ(CameraModel::load(path).focal_px, Eigen::Vector2d(250, 251)) << name;
  }
}

TEST(OpenCvFile, SuppliesIntrinsicsToSensorYaml) {
  const omnifleet::test::TempFolder folder;
  {
    cv::FileStorage file(folder / "c.yml", cv::FileStorage::WRITE);
    file << "camera_matrix" << cv::Mat(cv::Matx33d(250, 0, 401, 0, 251, 299, 0, 0, 1));
  }
  EXPECT_THAT(refusal(folder / "c.yml"), HasSubstr("image_width"))
      << "the file does not state the image size";
  const CameraModel m = CameraModel::load(written(folder, "sensor.yaml",
                                                  "camera_model: pinhole\ncalibration: c.yml\nimage_width: "
                                                  "800\nimage_height: 600\nposition_m: [0, 0, 2.5]\n"));
  EXPECT_EQ(m.projection, Projection::kPinhole);
  EXPECT_EQ(m.focal_px, Eigen::Vector2d(250, 251));
  EXPECT_EQ(m.position_m.z(), 2.5);
}

TEST(OpenCvFile, RejectsDamagedOrIncompleteFile) {
  const omnifleet::test::TempFolder folder;
  EXPECT_THAT(refusal(written(folder, "d.yml", "%YAML:1.0\n---\ncamera_matrix: [1, 2\n")),
              HasSubstr("d.yml"));
  EXPECT_THAT(refusal(written(folder, "e.yml", "%YAML:1.0\n---\nimage_width: 10\nfisheye_model: 1\n")),
              HasSubstr("camera_matrix"));
}

TEST(OpenCvFile, ReadsPublishedCalibration) {
  OMNIFLEET_NEEDS_DATA(path, "overhead/vss/cameraCoefficients.xml");
  const CameraModel m = CameraModel::load(path);
  EXPECT_EQ(m.image_width_px, 640);
  EXPECT_EQ(m.projection, Projection::kPinhole);
  EXPECT_NEAR(m.focal_px.x(), 686.75122933366697, 1e-9);
  EXPECT_NEAR(m.principal_point_px.y(), 239.5, 1e-12);
  EXPECT_NEAR(m.distortion.at(4), -1.2212585907399578, 1e-12);
}

constexpr const char* kKalibr =
    "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.01, -0.002, 0.001, -0.0003]\n"
    "  distortion_model: equidistant\n  intrinsics: [190.97, 190.97, 254.93, 256.89]\n  resolution: [512, "
    "512]\n"
    "  rostopic: /cam0/image_raw\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, 0.0]\n  - [0.0, 1.0, 0.0, 0.0]\n"
    "  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n";

TEST(KalibrFile, ReadsFirstCameraOfCamchain) {
  const omnifleet::test::TempFolder folder;
  const CameraModel m = CameraModel::load(written(folder, "camchain.yaml", kKalibr));
  EXPECT_EQ(m.projection, Projection::kKannalaBrandt);
  EXPECT_EQ(m.focal_px, Eigen::Vector2d(190.97, 190.97));
  EXPECT_EQ(m.principal_point_px, Eigen::Vector2d(254.93, 256.89));
  EXPECT_EQ(m.image_width_px, 512);
  std::string other = kKalibr;
  other.replace(other.find("equidistant"), 11, "fov");
  EXPECT_THAT(refusal(written(folder, "o.yaml", other)), HasSubstr("distortion_model"));
}

TEST(CameraInfoFile, ReadsPlainYamlWithOpenCvKeys) {
  const omnifleet::test::TempFolder folder;
  const CameraModel m = CameraModel::load(
      written(folder, "info.yaml",
              "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
              "  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\ndistortion_model: "
              "plumb_bob\ndistortion_coefficients:\n  rows: 1\n"
              "  cols: 5\n  data: [0.1, -0.2, 0.001, 0.002, 0]\n"));
  EXPECT_EQ(m.projection, Projection::kPinhole);
  EXPECT_EQ(m.focal_px, Eigen::Vector2d(500, 501));
  EXPECT_THAT(m.distortion, ::testing::ElementsAre(0.1, -0.2, 0.001, 0.002, 0.0));
}

}  // namespace
}  // namespace omnifleet::lens::test
