#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/core/persistence.hpp>
#include <string>

#include "lens/models.h"

namespace omnifleet::lens {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

[[noreturn]] void fail(const std::string& path, const std::string& problem) {
  throw options::Error(fmt::format("{}: {}", path, problem));
}

/// The numbers that every calibration file states, each format under its own keys.
struct Intrinsics {
  int width_px = 0, height_px = 0;
  std::vector<double> camera_matrix;  ///< 9 values, row-major
  std::vector<double> distortion;
  bool fisheye = false;  ///< OpenCV's fisheye model; otherwise its pinhole model
};

void toModel(const std::string& path, const Intrinsics& in, CameraModel& model) {
  if (in.camera_matrix.size() != 9) fail(path, "camera_matrix: must be 3×3");
  if (in.width_px > 0) model.image_width_px = in.width_px;
  if (in.height_px > 0) model.image_height_px = in.height_px;
  if (model.image_width_px <= 0 || model.image_height_px <= 0) {
    fail(path,
         "image_width, image_height: missing; add them, or refer to this file under `calibration:` in a "
         "sensor.yaml that states them");
  }
  model.kind = in.fisheye ? CameraKind::kFisheye : CameraKind::kPinhole;
  model.projection = in.fisheye ? Projection::kKannalaBrandt : Projection::kPinhole;
  model.focal_px = {in.camera_matrix[0], in.camera_matrix[4]};
  model.principal_point_px = {in.camera_matrix[2], in.camera_matrix[5]};
  model.distortion = in.distortion;
  const auto is_zero = [](double value) { return value == 0.0; };
  while (model.distortion.size() > 8 && is_zero(model.distortion.back())) model.distortion.pop_back();
  if (in.fisheye) {
    try {
      model.fov_deg = widestFovDeg(model);
    } catch (const options::Error& error) {
      fail(path, error.what());
    }
  }
}

bool isFisheyeName(const std::string& name) {
  const std::string text = lower(name);
  return text == "equidistant" || text == "fisheye" || text == "kannala_brandt";
}

std::vector<double> values(const cv::FileNode& node) {
  cv::Mat matrix;
  if (node.isMap()) {
    node >> matrix;
  } else if (node.isSeq()) {
    std::vector<double> list;
    node >> list;
    return list;
  }
  cv::Mat real;
  matrix.convertTo(real, CV_64F);
  return std::vector<double>(real.begin<double>(), real.end<double>());
}

void readVector3(const cv::FileNode& node, Eigen::Vector3d& out) {
  const std::vector<double> v = values(node);
  if (v.size() == 3) out = {v[0], v[1], v[2]};
}

/// OpenCV's calibration programs spell their keys in several ways (camera_matrix, Camera_Matrix,
/// cameraMatrix, K).
void readOpenCv(const std::string& path, const std::string& text, CameraModel& model) {
  Intrinsics in;
  try {
    const cv::FileStorage file(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!file.isOpened()) fail(path, "cannot be read as an OpenCV FileStorage");
    const cv::FileNode root = file.root();
    for (const cv::FileNode& node : root) {
      std::string key = lower(node.name());
      key.erase(std::remove(key.begin(), key.end(), '_'), key.end());
      if (key == "cameramatrix" || key == "k") in.camera_matrix = values(node);
      if (key == "distortioncoefficients" || key == "distcoeffs" || key == "d") in.distortion = values(node);
      if (key == "imagewidth") in.width_px = static_cast<int>(node.real());
      if (key == "imageheight") in.height_px = static_cast<int>(node.real());
      if (key == "imagesize" && node.size() == 2) {
        in.width_px = static_cast<int>(node[0].real());
        in.height_px = static_cast<int>(node[1].real());
      }
      if (key == "fisheyemodel") in.fisheye = node.isInt() && static_cast<int>(node) != 0;
      if (key == "distortionmodel") in.fisheye = isFisheyeName(node.string());
      if (key == "xi" && node.isReal() && node.real() != 0.0)
        fail(path, "xi: the omnidir model is not supported; calibrate the lens as ocam");
      if (key == "positionm") readVector3(node, model.position_m);
      if (key == "rotationrpydeg") readVector3(node, model.rotation_rpy_deg);
      if (key == "selfmaskradiuspx") model.self_mask_radius_px = node.real();
    }
  } catch (const cv::Exception& error) {
    fail(path, fmt::format("not a valid OpenCV FileStorage: {}", error.err));
  }
  toModel(path, in, model);
}

std::vector<double> numbers(const std::string& path, const YAML::Node& node, const std::string& key) {
  try {
    return node.as<std::vector<double>>();
  } catch (const YAML::Exception&) {
    throw options::Error(
        fmt::format("{}:{}: {}: expected a list of numbers", path, node.Mark().line + 1, key));
  }
}

/// ROS camera_info as the `camera_calibration` tool writes it: the keys of OpenCV in plain YAML.
void readCameraInfo(const std::string& path, const YAML::Node& root, CameraModel& model) {
  Intrinsics in;
  in.width_px = root["image_width"].as<int>(0);
  in.height_px = root["image_height"].as<int>(0);
  in.camera_matrix = numbers(path, root["camera_matrix"]["data"], "camera_matrix.data");
  if (root["distortion_coefficients"]) {
    in.distortion = numbers(path, root["distortion_coefficients"]["data"], "distortion_coefficients.data");
  }
  in.fisheye = isFisheyeName(root["distortion_model"].as<std::string>(""));
  toModel(path, in, model);
}

/// The first camera of a Kalibr camchain. T_cam_imu is ignored, because it is not a pose in base_link.
void readKalibr(const std::string& path, const YAML::Node& camera, CameraModel& model) {
  const auto at = [&](const char* key) {
    if (!camera[key])
      throw options::Error(fmt::format("{}:{}: cam0.{}: is required", path, camera.Mark().line + 1, key));
    return camera[key];
  };
  const auto kind = at("camera_model").as<std::string>();
  if (kind != "pinhole") fail(path, fmt::format("cam0.camera_model: '{}' must be pinhole", kind));
  const std::vector<double> f = numbers(path, at("intrinsics"), "cam0.intrinsics");
  const std::vector<double> size = numbers(path, at("resolution"), "cam0.resolution");
  if (f.size() != 4 || size.size() != 2)
    fail(path, "cam0: intrinsics must be [fu, fv, pu, pv], resolution must be [width, height]");
  Intrinsics in{static_cast<int>(size[0]),
                static_cast<int>(size[1]),
                {f[0], 0, f[2], 0, f[1], f[3], 0, 0, 1},
                {},
                false};
  const auto distortion = camera["distortion_model"].as<std::string>("none");
  if (distortion != "equidistant" && distortion != "radtan" && distortion != "none") {
    fail(path,
         fmt::format("cam0.distortion_model: '{}' must be one of equidistant, radtan, none", distortion));
  }
  in.fisheye = distortion == "equidistant";
  if (distortion != "none") in.distortion = numbers(path, at("distortion_coeffs"), "cam0.distortion_coeffs");
  toModel(path, in, model);
}

}  // namespace

bool readForeignCalibration(const std::string& path, CameraModel& model) {
  std::ifstream file(path);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (text.rfind("\xEF\xBB\xBF", 0) == 0)
    text.erase(0, 3);  // a byte order mark, which OpenCV does not accept
  if (text.rfind("%YAML", 0) == 0 || text.rfind("<?xml", 0) == 0) {
    readOpenCv(path, text, model);
    return true;
  }
  try {
    const YAML::Node root = YAML::LoadFile(path);
    if (!root.IsMap()) return false;
    if (root["cam0"]) {
      readKalibr(path, root["cam0"], model);
      return true;
    }
    if (root["camera_matrix"] && root["camera_matrix"]["data"]) {
      readCameraInfo(path, root, model);
      return true;
    }
  } catch (const YAML::BadConversion& error) {
    throw options::Error(fmt::format("{}:{}: unexpected type of value", path, error.mark.line + 1));
  } catch (const YAML::Exception&) {
    return false;  // the options reader reports the error with its line
  }
  return false;
}

}  // namespace omnifleet::lens
