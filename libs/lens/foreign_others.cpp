// Formats that are recognised by their keys, but not read: what each is called and how to convert it.
#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

constexpr const char* kByHand =
    "Write its numbers into a sensor.yaml: camera_model, projection, image_width, image_height, focal_px, "
    "principal_point_px, distortion";

bool hasAny(const YAML::Node& root, const std::vector<std::string>& keys) {
  for (const auto& entry : root) {
    if (!entry.first.IsScalar()) continue;
    const std::string key = normalized(entry.first.Scalar());
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) return true;
  }
  return false;
}

/// COLMAP: "1 OPENCV_FISHEYE 960 600 …" per line.
bool isColmap(const std::string& text) {
  std::istringstream in(text);
  bool any = false;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    std::istringstream words(line);
    int id = 0, width = 0, height = 0;
    std::string model;
    if (!(words >> id >> model >> width >> height)) return false;
    if (model.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_") != std::string::npos) return false;
    any = true;
  }
  return any;
}

/// ROS: sections [image] and [NAME] with "camera matrix", "distortion", "projection" above their numbers.
bool isOstIni(const std::string& text) {
  bool image = false, matrix = false, distortion = false;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    line.erase(line.find_last_not_of(" \t\r") + 1);
    image = image || line == "[image]";
    matrix = matrix || line == "camera matrix";
    distortion = distortion || line == "distortion";
  }
  return image && matrix && distortion;
}

}  // namespace

std::string otherFormat(const Document& document) {
  if (isOstIni(document.text))
    return "the ini file of ROS's camera_calibration (ost.ini). Use the ost.yaml that the calibrator saves "
           "beside "
           "it, or convert the file: rosrun camera_calibration_parsers convert ost.ini ost.yaml";
  if (isColmap(document.text))
    return fmt::format(
        "cameras.txt of COLMAP. {} (OPENCV_FISHEYE is kannala_brandt: fx fy cx cy k1 k2 k3 k4; OPENCV and "
        "FULL_OPENCV are pinhole). COLMAP's principal point is 0.5 px larger",
        kByHand);
  if (!document.isMap()) return {};
  const YAML::Node& root = document.root;
  if (hasAny(root, {"camera.type", "camera.fx", "camera1.fx", "camera.cx"}))
    return fmt::format(
        "settings of ORB-SLAM. {} (KannalaBrandt8: projection kannala_brandt with k1 … k4; PinHole: "
        "projection pinhole with k1, k2, p1, p2, k3)",
        kByHand);
  if (hasAny(root, {"modeltype"}) &&
      hasAny(root, {"projectionparameters", "mirrorparameters", "distortionparameters"}))
    return fmt::format(
        "a file of VINS (camodocal). KANNALA_BRANDT: {} (kannala_brandt; k2 … k5 are our k1 … k4; mu, mv "
        "are focal_px; u0, v0 the principal point). MEI and SCARAMUZZA: calibrate again with "
        "scripts/calibrate.sh --projection ocam",
        kByHand);
  const auto camera0 = root["camera_0"];
  if (hasAny(root, {"nbcamera"}) || (camera0 && camera0.IsMap() && camera0["distortion_vector"]))
    return fmt::format(
        "a file of MC-Calib. {} (distortion_type 1: kannala_brandt; 0: pinhole), one sensor.yaml per "
        "camera",
        kByHand);
  if (hasAny(root, {"fx"}) && hasAny(root, {"fy"}))
    return fmt::format("a list of fx, fy, cx, cy whose lens model no key states. {}", kByHand);
  if (hasAny(root, {"k1", "k2", "d1", "d2", "m1", "m2", "cameramatrix1", "cameramatrix2", "cameramatrixleft",
                    "cameramatrixright", "leftcameramatrix", "rightcameramatrix", "kl", "kr", "dl", "dr"}) &&
      !hasAny(root, {"cameramatrix", "focalpx", "projection"}))
    return "a stereo file of OpenCV (K1, D1 or M1, D1 …). Copy the matrix and the distortion of one camera "
           "into a file with the keys camera_matrix, distortion_coefficients, image_width, image_height and "
           "fisheye_model (1 for cv::fisheye, 0 for pinhole)";
  if (hasAny(root, {"mappingcoefficients"}))
    return "fisheyeIntrinsics of MATLAB. Write projection: ocam, and distortion: [−a0, 0, −a2, −a3, −a4, c, "
           "d, e] with "
           "the stretch matrix [c d; e 1], principal_point_px: DistortionCenter − 1";
  const auto value0 = root["value0"];
  if (value0 && value0.IsMap() && value0["intrinsics"])
    return fmt::format(
        "a file of Basalt. kb4: {} (kannala_brandt). Other models: calibrate again with "
        "scripts/calibrate.sh",
        kByHand);
  if (hasAny(root, {"flx", "fly"}))
    return fmt::format("transforms.json of nerfstudio or instant-ngp. {} (OPENCV_FISHEYE is kannala_brandt)",
                       kByHand);
  for (const auto& entry : root) {
    if (entry.second.IsMap() && entry.second["projection_type"])
      return fmt::format(
          "camera_models.json of OpenSfM. {}; its focal length is relative to the larger side of the image",
          kByHand);
  }
  return {};
}

}  // namespace omnifleet::lens
