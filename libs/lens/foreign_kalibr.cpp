// Kalibr's camchain, and the sensor.yaml of one camera in ASL/EuRoC data sets, which has the same terms.
#include <fmt/format.h>

#include <algorithm>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

/// Keys that do not change the lens: names, times, and poses against other sensors of Kalibr's rig.
const std::vector<std::string> kKalibrIrrelevant{
    "rostopic", "cam_overlaps", "T_cn_cnm1", "T_cam_imu", "T_imu_cam", "T_cam_body",  "timeshift_cam_imu",
    "comment",  "sensor_type",  "rate_hz",   "T_BS",      "label",     "image_folder"};

bool isCameraKey(const std::string& key) {
  return key.size() > 3 && key.rfind("cam", 0) == 0 &&
         key.find_first_not_of("0123456789", 3) == std::string::npos;
}

bool describesCamera(const YAML::Node& node) {
  return node.IsMap() && node["intrinsics"] && node["intrinsics"].IsSequence() &&
         (node["distortion_model"] || node["camera_model"] || node["resolution"]);
}

std::vector<std::string> camerasOf(const Document& document) {
  std::vector<std::string> names;
  for (const auto& entry : document.root) {
    if (isCameraKey(entry.first.Scalar())) names.push_back(entry.first.Scalar());
  }
  std::sort(names.begin(), names.end());
  return names;
}

class KalibrCamera {
 public:
  KalibrCamera(const Document& document, const YAML::Node& camera, const std::string& name)
      : document_(document), camera_(camera), prefix_(name.empty() ? "" : name + ".") {}

  ForeignLens read() const {
    for (const auto& entry : camera_) checkKey(entry.first.Scalar(), entry.second);
    ForeignLens lens;
    lens.path = document_.path;
    lens.format = "Kalibr";
    const std::string kind = text("camera_model");
    if (kind != "pinhole")
      fail("camera_model",
           fmt::format("'{}' must be pinhole, in Kalibr's files also for a fisheye lens (distortion_model: "
                       "equidistant): the models omni, eucm and ds are not supported. Calibrate again with "
                       "Kalibr's pinhole-equi, or with scripts/calibrate.sh",
                       kind));
    const std::vector<double> f = numbers("intrinsics"), size = numbers("resolution");
    if (f.size() != 4) fail("intrinsics", fmt::format("must be [fu, fv, pu, pv], has {} numbers", f.size()));
    if (size.size() != 2) fail("resolution", "must be [width, height]");
    lens.focal_px = {f[0], f[1]};
    lens.principal_point_px = {f[2], f[3]};
    lens.width_px = static_cast<int>(size[0]);
    lens.height_px = static_cast<int>(size[1]);
    readDistortion(lens);
    return lens;
  }

 private:
  void checkKey(const std::string& key, const YAML::Node& node) const {
    static const std::vector<std::string> kKnown{"camera_model",      "intrinsics",
                                                 "resolution",        "distortion_model",
                                                 "distortion_coeffs", "distortion_coefficients"};
    const auto in = [&](const std::vector<std::string>& list) {
      return std::find(list.begin(), list.end(), key) != list.end();
    };
    if (in(kKnown) || in(kKalibrIrrelevant)) return;
    throw options::Error(
        fmt::format("{}: {}{}: {}", document_.place(node), prefix_, key,
                    isOwnKey(key, node)
                        ? "is a key of sensor.yaml; write it there, beside `calibration:`"
                        : "unknown key in a file of Kalibr; if it changes the lens, calibrate without it; "
                          "otherwise delete it"));
  }

  void readDistortion(ForeignLens& lens) const {
    const std::string model = text("distortion_model");
    const std::string plain = normalized(model);
    const bool fisheye = plain == "equidistant", none = plain == "none";
    if (!fisheye && !none && plain != "radtan" && plain != "radialtangential")
      fail("distortion_model",
           fmt::format("'{}' must be one of equidistant, radtan, none. Calibrate again with "
                       "Kalibr's pinhole-equi or pinhole-radtan",
                       model));
    lens.family = fisheye ? Family::kFisheye : Family::kPinhole;
    lens.stated_by = fmt::format("{}distortion_model: {}", prefix_, model);
    const char* key = camera_["distortion_coefficients"] ? "distortion_coefficients" : "distortion_coeffs";
    if (!none || camera_[key]) lens.distortion = numbers(key);
    const std::size_t n = lens.distortion.size();
    if (n != (none ? 0 : 4)) fail(key, fmt::format("'{}' needs {} values, got {}", model, none ? 0 : 4, n));
  }

  YAML::Node at(const char* key) const {
    const YAML::Node node = camera_[key];
    if (!node)
      throw options::Error(fmt::format("{}: {}{}: is required", document_.place(camera_), prefix_, key));
    return node;
  }
  std::string text(const char* key) const { return textOf(document_, at(key), prefix_ + key); }
  std::vector<double> numbers(const char* key) const { return numbersOf(document_, at(key), prefix_ + key); }
  [[noreturn]] void fail(const char* key, const std::string& problem) const {
    throw options::Error(fmt::format("{}: {}{}: {}", document_.place(at(key)), prefix_, key, problem));
  }

  const Document& document_;
  const YAML::Node camera_;
  std::string prefix_;
};

}  // namespace

bool isKalibr(const Document& document) {
  if (!document.isMap()) return false;
  if (describesCamera(document.root)) return true;
  const std::vector<std::string> names = camerasOf(document);
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& name) { return document.root[name].IsMap(); });
}

ForeignLens readKalibr(const Document& document, const std::string& camera) {
  const std::vector<std::string> names = camerasOf(document);
  if (names.empty()) {
    if (!camera.empty())
      throw options::Error(
          fmt::format("{}: camera: '{}': this file describes one camera without a name; remove "
                      "`camera:`",
                      document.path, camera));
    return KalibrCamera(document, document.root, "").read();
  }
  for (const auto& entry : document.root) {
    const std::string& key = entry.first.Scalar();
    if (isCameraKey(key)) continue;
    throw options::Error(fmt::format("{}: {}: unknown key beside the cameras of a Kalibr camchain; delete it",
                                     document.place(entry.first), key));
  }
  std::string name = camera;
  if (name.empty() && names.size() > 1)
    throw options::Error(
        fmt::format("{}: has {} cameras ({}); choose one with `camera: {}` in the sensor.yaml", document.path,
                    names.size(), fmt::join(names, ", "), names.front()));
  if (name.empty()) name = names.front();
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw options::Error(fmt::format("{}: has no camera '{}' (`camera:`); it has {}", document.path, name,
                                     fmt::join(names, ", ")));
  if (!document.root[name].IsMap())
    throw options::Error(fmt::format("{}: {}: expected the keys of a camera", document.path, name));
  return KalibrCamera(document, document.root[name], name).read();
}

}  // namespace omnifleet::lens
