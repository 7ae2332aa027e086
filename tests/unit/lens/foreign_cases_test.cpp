// Calibration files as people have them. Each row is one class of input: either it gives exactly the lens
// that the file says, or the refusal names the cause.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/lens/foreign_for_tests.h"

namespace omnifleet::lens::test {
namespace {

using ::testing::HasSubstr;

const std::string kMount = "position_m: [0, 0, 0.5]\nself_mask_radius_px: 150\n";
const std::string kNamed = "calibration: cal.yml\n" + kMount;
const std::string kSize = "image_width: 960\nimage_height: 600\n";
const std::string kOpenCvMatrix =
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 230., 0., 480., 0., 230., 300., 0., 0., 1. ]\n";
const std::string kOpenCvDistortion =
    "distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n"
    "   data: [ 0.013, 0.003, -0.006, 0.001 ]\n";
const std::string kHead = "%YAML:1.0\n---\n";
const std::string kOpenCv = kHead + kSize + kOpenCvMatrix + kOpenCvDistortion;
const std::string kRos =
    kSize +
    "camera_name: cam\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [ 230., 0., 480., 0., 230., 300., 0., 0., 1. ]\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0.013, 0.003, -0.006, 0.001]\n";
const std::string kJson =
    R"({"image_width": 960, "image_height": 600, "fisheye_model": 1,
 "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
	"data": [230.0, 0.0, 480.0, 0.0, 230.0, 300.0, 0.0, 0.0, 1.0]},
 "distortion_coefficients": {"type_id": "opencv-matrix", "rows": 4, "cols": 1, "dt": "d",
	"data": [0.013, 0.003, -0.006, 0.001]}})";
const std::string kKalibrCamera =
    "  camera_model: pinhole\n  distortion_coeffs: [0.013, 0.003, -0.006, 0.001]\n"
    "  distortion_model: equidistant\n  intrinsics: [230.0, 230.0, 480.0, 300.0]\n  resolution: [960, 600]\n";
const std::string kSecondCamera =
    "cam1:\n  camera_model: pinhole\n  distortion_coeffs: [0.02, 0.0, 0.0, 0.0]\n"
    "  distortion_model: equidistant\n  intrinsics: [200.0, 200.0, 470.0, 310.0]\n  resolution: [960, 600]\n";

std::string without(std::string text, const std::string& part) {
  text.erase(text.find(part), part.size());
  return text;
}
std::string with(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

const std::string kXml =
    "<?xml "
    "version=\"1.0\"?>\n<opencv_storage>\n<image_width>960</image_width>\n<image_height>600</image_height>\n"
    "<fisheye_model>1</fisheye_model>\n<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n"
    "  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    230. 0. 480. 0. 230. 300. 0. 0. "
    "1.</data></camera_matrix>\n"
    "<distortion_coefficients type_id=\"opencv-matrix\">\n  <rows>4</rows>\n  <cols>1</cols>\n  <dt>d</dt>\n"
    "  <data>\n    1.3e-02 3e-03 -6e-03 1e-03</data></distortion_coefficients>\n</opencv_storage>\n";
const std::string kOcamCalib =
    "#DIRECT\n\n5 -2.300000e+02 0.000000e+00 8.6e-04 -3.6e-08 6.7e-09\n\n#inverse\n\n"
    "11 3.64090778e+02 1.91178049e+02 -1.76807318e+01 3.77389365e+01 8.17621341e+00 2.09884615e+01 "
    "3.76839815e+01 -4.68681421e+01 -9.44097981e+01 -5.01207974e+01 -8.89811479e+00\n\n"
    "#center\n\n299.5 479.5\n\n#affine\n\n1.0001 0.0002 -0.0001\n\n#image size\n\n600 960\n";

/// The camera of a camchain as a file of one camera.
std::string unindented(std::string text) {
  text.erase(0, 2);
  for (std::size_t at = 0; (at = text.find("\n  ", at)) != std::string::npos; ++at) text.erase(at + 1, 2);
  return text;
}

struct Row {
  const char* name;
  std::string sensor, calibration;
  std::string refused;  ///< part of the refusal; empty: read as the fisheye lens of all these files
};

std::vector<Row> rows() {
  return {
      {"FisheyeThatTheUserStates", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount, kOpenCv, ""},
      {"FisheyeThatTheUserStatesAsProjection", "calibration: cal.yml\nprojection: kannala_brandt\n" + kMount,
       kOpenCv, ""},
      {"NobodyStatesTheModel", kNamed, kOpenCv, "states no lens model"},
      {"RosCameraModelFisheye", kNamed, kRos + "camera_model: fisheye\n", ""},
      {"RosEquidistant", kNamed, kRos + "distortion_model: equidistant\n", ""},
      {"RosUnknownModel", kNamed, kRos + "distortion_model: no_such_model\n", "'no_such_model' is not known"},
      {"RosDoubleSphere", kNamed, kRos + "distortion_model: double_sphere\n", "'double_sphere' is not known"},
      {"OpenCvFileWithOwnKeys",
       kOpenCv + "camera_model: fisheye\nprojection: kannala_brandt\nfov_deg: 185\n" + kMount, "", ""},
      {"OwnKeyContradictsFile", kOpenCv + "fisheye_model: 1\ncamera_model: pinhole\n" + kMount, "",
       "camera_model: contradicts"},
      {"UserContradictsFile", "calibration: cal.yml\nprojection: pinhole\n" + kMount,
       kOpenCv + "fisheye_model: 1\n", "projection: contradicts"},
      {"EquisolidIsNoModelOfTheseFiles", "calibration: cal.yml\nprojection: equisolid\n" + kMount,
       kOpenCv + "fisheye_model: 1\n", "kannala_brandt"},
      {"FileContradictsItself", kNamed, kOpenCv + "fisheye_model: 1\ndistortion_model: plumb_bob\n",
       "contradicts `fisheye_model: 1`"},
      {"OpenCvFisheye", kNamed, kOpenCv + "fisheye_model: 1\n", ""},
      {"CommentAboveHeader", kNamed, "# camera 3\n" + kOpenCv + "fisheye_model: 1\n", ""},
      {"WithoutHeader", kNamed, without(kOpenCv, kHead) + "fisheye_model: 1\n", ""},
      {"Json", kNamed, kJson, ""},
      {"OmnidirXiAsMatrix", kNamed,
       kOpenCv + "xi: !!opencv-matrix\n   rows: 1\n   cols: 1\n   dt: d\n   data: [ 1.2 ]\n", "cv::omnidir"},
      {"OmnidirXiAsNumber", kNamed, kOpenCv + "xi: 1.2\n", "cv::omnidir"},
      {"OmnidirThatUserCallsFisheye", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount,
       kOpenCv + "xi: 1.2\n", "cv::omnidir"},
      {"DistortionUnderUnknownKey", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount,
       with(kOpenCv, "distortion_coefficients", "lens_coefficients"), "lens_coefficients: unknown key"},
      {"DistortionUnderKnownKeys", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount,
       with(kOpenCv, "distortion_coefficients", "dist_coeffs"), ""},
      {"DistortionTwice", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount,
       kOpenCv + "D: [0, 0, 0, 0]\n", "means the same as"},
      {"OwnKeyInForeignFile", kNamed, kOpenCv + "fisheye_model: 1\nfov_deg: 185\n",
       "is a key of sensor.yaml"},
      {"OtherImageSize", kNamed + "image_width: 640\n", kOpenCv + "fisheye_model: 1\n",
       "image_width: 640 contradicts"},
      {"FiveFisheyeCoefficients", kNamed,
       with(with(kOpenCv, "rows: 4", "rows: 5"), "0.001 ]", "0.001, 0.5 ]") + "fisheye_model: 1\n",
       "has 5 distortion coefficients"},
      {"MatrixOfWrongSize", kNamed, with(kOpenCv, "rows: 4", "rows: 5") + "fisheye_model: 1\n",
       "has 4 numbers in `data`"},
      {"TransposedMatrix", kNamed,
       with(kOpenCv, "[ 230., 0., 480., 0., 230., 300., 0., 0., 1. ]",
            "[ 230., 0., 0., 0., 230., 0., 480., 300., 1. ]") +
           "fisheye_model: 1\n",
       "transposed"},
      {"RectifiedStereo", kNamed,
       kRos + "distortion_model: equidistant\nrectification_matrix:\n  rows: 3\n  cols: 3\n"
              "  data: [0.98, 0.2, 0, -0.2, 0.98, 0, 0, 0, 1]\n",
       "rectification_matrix: is not the identity"},
      {"KalibrWithHeader", kNamed, "%YAML:1.0\ncam0:\n" + kKalibrCamera, ""},
      {"KalibrWithPosition", "cam0:\n" + kKalibrCamera + kMount, "", ""},
      {"RosWithPosition", kRos + "distortion_model: equidistant\n" + kMount, "", ""},
      {"KalibrTwoCameras", kNamed, "cam0:\n" + kKalibrCamera + kSecondCamera, "has 2 cameras (cam0, cam1)"},
      {"KalibrChosenCamera", "camera: cam0\n" + kNamed, "cam0:\n" + kKalibrCamera + kSecondCamera, ""},
      {"KalibrTwoCamerasAsSensorYaml", "camera: cam0\ncam0:\n" + kKalibrCamera + kSecondCamera + kMount, "",
       ""},
      {"KalibrMissingCamera", "camera: cam7\n" + kNamed, "cam0:\n" + kKalibrCamera + kSecondCamera,
       "has no camera 'cam7'"},
      {"RosOtherCamera", "camera: left\n" + kNamed, kRos + "distortion_model: equidistant\n",
       "has no camera 'left'"},
      {"CameraWithoutCalibration", "camera: cam0\n" + kMount, "", "there is no `calibration:`"},
      {"KalibrCameraAsSensorYaml", unindented(kKalibrCamera) + kMount, "", ""},
      {"KalibrCameraAsSensorYamlWithAnotherModel",
       with(unindented(kKalibrCamera), "pinhole", "fisheye") + kMount, "",
       "camera_model: 'fisheye' must be pinhole"},
      {"EurocAsSensorYaml",
       "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, "
       "0, 1]\n"
       "rate_hz: 20\n" +
           with(unindented(kKalibrCamera), "distortion_coeffs", "distortion_coefficients") + kMount,
       "", ""},
      {"SecondYamlDocument", kNamed, kOpenCv + "fisheye_model: 1\n---\nxi: 1.2\n",
       "cal.yml:17: xi: a second YAML document"},
      {"SecondYamlDocumentOfSensorYaml", kOpenCv + "fisheye_model: 1\n" + kMount + "---\nfov_deg: 185\n", "",
       "fov_deg: a second YAML document"},
      {"EmptySecondDocument", kNamed, kOpenCv + "fisheye_model: 1\n---\n", ""},
      {"FisheyeWithoutDistortion", kNamed, without(kOpenCv, kOpenCvDistortion) + "fisheye_model: 1\n",
       "cal.yml: has no distortion coefficients"},
      {"FisheyeOfUserWithoutDistortion", "calibration: cal.yml\ncamera_model: fisheye\n" + kMount,
       without(kOpenCv, kOpenCvDistortion), "cal.yml: has no distortion coefficients"},
      {"FisheyeWithDistortionOfUser", "distortion: [0.013, 0.003, -0.006, 0.001]\n" + kNamed,
       without(kOpenCv, kOpenCvDistortion) + "fisheye_model: 1\n", ""},
      {"NanOfKalibr", kNamed, "cam0:\n" + with(kKalibrCamera, "0.003", ".nan"),
       "cal.yml:3: cam0.distortion_coeffs: value 2 is .nan"},
      {"NanOfOpenCv", kNamed, with(kOpenCv, "0.003", ".Nan") + "fisheye_model: 1\n", "value 2 is .Nan"},
      {"InfinityInMatrix", kNamed, with(kOpenCv, "480.", "-.inf") + "fisheye_model: 1\n", "value 3 is -.inf"},
      {"WordInMatrix", kNamed, with(kOpenCv, "480.", "wide") + "fisheye_model: 1\n",
       "camera_matrix: expected a list of numbers"},
      {"XmlCommentAboveDeclaration", kNamed, "<!-- camera 3 -->\n<!-- lab -->\n" + kXml, ""},
      {"XmlWithoutDeclaration", kNamed, without(kXml, "<?xml version=\"1.0\"?>\n"), ""},
      {"RosIni", kNamed,
       "# oST version 5.0 parameters\n\n[image]\n\nwidth\n960\n\nheight\n600\n\n[narrow_stereo]\n\n"
       "camera matrix\n230 0 480\n0 230 300\n0 0 1\n\ndistortion\n0.01 0.0 0.0 0.0 0.0\n",
       "ost.yaml"},
      {"OcamCalibWithHeightAndWidthExchanged", kNamed, with(kOcamCalib, "600 960", "960 600"),
       "either width and height are exchanged"},
      {"OcamCalibWithNan", kNamed, with(kOcamCalib, "8.6e-04", "nan"),
       "value 4 of the numbers below comment 1 is nan"},
      {"KalibrFov", kNamed, "cam0:\n" + with(kKalibrCamera, "equidistant", "fov"), "'fov' must be one of"},
      {"KalibrOmni", kNamed, "cam0:\n" + with(kKalibrCamera, "pinhole", "omni"), "omni, eucm and ds"},
      {"KalibrUnknownKey", kNamed, "cam0:\n" + kKalibrCamera + "  line_delay: 1e-5\n",
       "line_delay: unknown key"},
      {"KalibrKeyBesideCameras", kNamed, "cam0:\n" + kKalibrCamera + "skew: 0.5\n",
       "skew: unknown key beside the cameras"},
      {"KalibrThreeIntrinsics", kNamed, "cam0:\n" + with(kKalibrCamera, "[230.0, 230.0,", "[230.0,"),
       "cam0.intrinsics: must be [fu, fv, pu, pv], has 3 numbers"},
      {"KalibrOneSideOfResolution", kNamed, "cam0:\n" + with(kKalibrCamera, "[960, 600]", "[960]"),
       "cam0.resolution: must be [width, height]"},
      {"KalibrFiveCoefficients", kNamed, "cam0:\n" + with(kKalibrCamera, "0.001]", "0.001, 0.0]"),
       "'equidistant' needs 4 values, got 5"},
      {"StereoFile", kNamed, kHead + with(kOpenCvMatrix, "camera_matrix", "K1"), "stereo file"},
      {"OrbSlam", kNamed, "Camera.type: \"KannalaBrandt8\"\nCamera1.fx: 230\n", "ORB-SLAM"},
      {"Vins", kNamed,
       "%YAML:1.0\n---\nmodel_type: MEI\ncamera_name: cam\nmirror_parameters:\n   xi: 1.9\n"
       "distortion_parameters:\n   k1: 0\nprojection_parameters:\n   gamma1: 600\n",
       "VINS"},
      {"McCalib", kNamed, "nb_camera: 1\ncamera_0:\n   distortion_type: 1\n", "MC-Calib"},
      {"Colmap", kNamed, "# Camera list\n1 OPENCV_FISHEYE 960 600 230 230 480 300 0.013 0.003 -0.006 0.001\n",
       "COLMAP"},
      {"Matlab", kNamed, "MappingCoefficients: [326, -8.6e-4, 3.6e-8, -6.7e-9]\n", "MATLAB"},
      {"Basalt", kNamed, R"({"value0": {"intrinsics": [{"camera_type": "kb4"}]}})", "Basalt"},
      {"Nerfstudio", kNamed, R"({"camera_model": "OPENCV_FISHEYE", "fl_x": 230, "fl_y": 230})", "nerfstudio"},
      {"OtherXml", kNamed, "<?xml version=\"1.0\"?>\n<calibration><f>230</f></calibration>\n", "FileStorage"},
      {"NoCalibration", kNamed, "hello: world\n", "the structure of no known calibration file"},
      {"MissingFile", "calibration: none.yml\n" + kMount, "", "no such file"},
      {"FileBesideItself", kOpenCv + "calibration: cal.yml\n" + kMount, kOpenCv, "remove one of them"},
      {"OcamWithoutAffinePart",
       "projection: ocam\nimage_width: 640\nimage_height: 480\nprincipal_point_px: [327, 262]\n"
       "distortion: [-326, 0, 8.6e-04, -3.6e-08, 6.7e-09]\n" +
           kMount,
       "", "distortion: [ss0, ss1, ss2, ss3, ss4, c, d, e] of ocam: the last three values"},
      {"OcamWithoutZeroOfMatlab",
       "projection: ocam\nimage_width: 640\nimage_height: 480\nprincipal_point_px: [327, 262]\nfov_deg: 180\n"
       "distortion: [-326, 8.6e-04, -3.6e-08, 6.7e-09, 1, 0, 0]\n" +
           kMount,
       "", "ss1 is 0.00086, but must be 0"},
      {"OcamInReverseOrder",
       "projection: ocam\nimage_width: 640\nimage_height: 480\nprincipal_point_px: [327, 262]\n"
       "distortion: [-6.7e-09, 3.6e-08, -8.6e-04, 0, -326, 1, 0, 0]\n" +
           kMount,
       "", "is the order reversed?"},
  };
}

TEST(CalibrationCases, GivesLensOfFileOrNamesCause) {
  for (const Row& row : rows()) {
    SCOPED_TRACE(row.name);
    const omnifleet::test::TempFolder folder;
    const Loaded loaded = loadText(folder, row.sensor, row.calibration);
    if (!row.refused.empty()) {
      EXPECT_THAT(loaded.refusal, HasSubstr(row.refused));
      EXPECT_THAT(loaded.refusal, HasSubstr(folder.path())) << "the refusal names the file";
      continue;
    }
    ASSERT_EQ(loaded.refusal, "");
    EXPECT_EQ(loaded.model.kind, CameraKind::kFisheye);
    EXPECT_EQ(loaded.model.projection, Projection::kKannalaBrandt);
    EXPECT_EQ(loaded.model.focal_px, Eigen::Vector2d(230, 230));
    EXPECT_EQ(loaded.model.principal_point_px, Eigen::Vector2d(480, 300));
    EXPECT_THAT(loaded.model.distortion, ::testing::ElementsAre(0.013, 0.003, -0.006, 0.001));
    EXPECT_EQ(loaded.model.image_width_px, 960);
    EXPECT_EQ(loaded.model.image_height_px, 600);
    EXPECT_EQ(loaded.model.position_m.z(), 0.5) << "the mounting is read in every form";
    EXPECT_EQ(loaded.model.self_mask_radius_px, 150.0);
  }
}

TEST(CalibrationCases, NamesLineOfOwnKeyInForeignFile) {
  const omnifleet::test::TempFolder folder;
  const Loaded loaded = loadText(folder, kOpenCv + "fisheye_model: 1\nposition_m: [0, 0, high]\n", "");
  EXPECT_THAT(loaded.refusal, HasSubstr("sensor.yaml:16: position_m"));
}

}  // namespace
}  // namespace omnifleet::lens::test
