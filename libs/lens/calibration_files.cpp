// Which calibration file this is, by its keys, and the way from a file to a ForeignLens.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

struct ModelName {
  const char* normalized;
  Family family;
};
constexpr std::array<ModelName, 16> kModelNames{{{"equidistant", Family::kFisheye},
                                                 {"fisheye", Family::kFisheye},
                                                 {"kannalabrandt", Family::kFisheye},
                                                 {"kannalabrandt4", Family::kFisheye},
                                                 {"kannalabrandt8", Family::kFisheye},
                                                 {"equi", Family::kFisheye},
                                                 {"opencvfisheye", Family::kFisheye},
                                                 {"plumbbob", Family::kPinhole},
                                                 {"rationalpolynomial", Family::kPinhole},
                                                 {"radtan", Family::kPinhole},
                                                 {"radialtangential", Family::kPinhole},
                                                 {"brownconrady", Family::kPinhole},
                                                 {"pinhole", Family::kPinhole},
                                                 {"perspective", Family::kPinhole},
                                                 {"rational", Family::kPinhole},
                                                 {"opencv", Family::kPinhole}}};

const std::vector<std::string> kOwnKeys{"camera_model", "projection",          "focal_px",
                                        "skew_px",      "principal_point_px",  "fov_deg",
                                        "position_m",   "rotation_rpy_deg",    "self_mask_radius_px",
                                        "calibration",  "reprojection_rms_px", "camera"};

int lineInXml(const std::string& text, const std::string& key) {
  const std::size_t at = text.find("<" + key);
  return at == std::string::npos ? 0
                                 : static_cast<int>(std::count(
                                       text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

/// Whether a key of the top level belongs to sensor.yaml, not to the other program. In a file of one camera
/// in Kalibr's terms `camera_model` is Kalibr's: pinhole, also for a fisheye lens.
bool belongsToSensor(const Document& document, FileKind kind, const std::string& key,
                     const YAML::Node& value) {
  const bool is_kalibrs = kind == FileKind::kKalibr && key == "camera_model" && document.root["intrinsics"];
  return isOwnKey(key, value) && !is_kalibrs;
}

/// The own keys of a document as a section whose messages keep the lines of the file.
options::Section ownSection(const Document& document, FileKind kind) {
  struct Own {
    int line;
    std::string key, value;
  };
  std::vector<Own> found;
  for (const auto& entry : document.root) {
    const std::string& key = entry.first.Scalar();
    if (!belongsToSensor(document, kind, key, entry.second)) continue;
    const bool matrix = entry.second.IsMap() && entry.second["data"];
    YAML::Emitter value;
    value << YAML::Flow << YAML::DoubleQuoted << key;
    YAML::Emitter content;
    content.SetMapFormat(YAML::Flow);
    content.SetSeqFormat(YAML::Flow);
    content << (matrix ? entry.second["data"] : entry.second);
    std::string text = content.c_str();
    std::replace(text.begin(), text.end(), '\n', ' ');
    const YAML::Mark mark = entry.first.Mark();
    found.push_back({mark.is_null() ? lineInXml(document.text, key) : mark.line, key, text});
  }
  std::stable_sort(found.begin(), found.end(), [](const Own& a, const Own& b) { return a.line < b.line; });
  std::string text;
  int line = 0;
  for (const Own& own : found) {
    for (; line < own.line; ++line) text += '\n';
    text += own.key + ": " + own.value + '\n';
    ++line;
  }
  return options::Section::parse(text, document.path);
}

Document withoutOwnKeys(const Document& document, FileKind kind) {
  Document rest = document;
  rest.root.reset(YAML::Node(YAML::NodeType::Map));  // `=` would empty the root of `document` as well
  for (const auto& entry : document.root) {
    if (!belongsToSensor(document, kind, entry.first.Scalar(), entry.second))
      rest.root.force_insert(entry.first, entry.second);
  }
  return rest;
}

}  // namespace

std::optional<Family> familyFromName(const std::string& name) {
  const std::string plain = normalized(name);
  for (const ModelName& known : kModelNames) {
    if (plain == known.normalized) return known.family;
  }
  return std::nullopt;
}

void failUnknownModel(const std::string& place, const std::string& key, const std::string& name) {
  throw options::Error(fmt::format(
      "{}: {}: '{}' is not known; known are equidistant, fisheye, kannala_brandt (fisheye), plumb_bob, "
      "rational_polynomial, radtan, pinhole (pinhole). If it is one of them under another name, write that "
      "name; "
      "otherwise calibrate again with scripts/calibrate.sh",
      place, key, name));
}

std::string familyName(Family family) {
  return family == Family::kPinhole ? "pinhole" : family == Family::kFisheye ? "fisheye" : "ocam";
}

bool isOwnKey(const std::string& key, const YAML::Node& value) {
  if (key == "distortion") return value.IsSequence();
  return std::find(kOwnKeys.begin(), kOwnKeys.end(), key) != kOwnKeys.end();
}

FileKind kindOf(const Document& document) {
  if (isOcamCalib(document)) return FileKind::kOcamCalib;
  if (isKalibr(document)) return FileKind::kKalibr;
  if (!otherFormat(document).empty()) return FileKind::kOther;
  return isMatrixFile(document) ? FileKind::kMatrix : FileKind::kOwn;
}

ForeignLens readForeign(const Document& document, FileKind kind, const std::string& camera) {
  if (kind == FileKind::kOther)
    throw options::Error(fmt::format("{}: is {}", document.path, otherFormat(document)));
  if (document.isMap()) rejectRepeatedKeys(document, document.root);
  if (kind == FileKind::kKalibr) return readKalibr(document, camera);
  const auto name = kind == FileKind::kMatrix ? document.root["camera_name"] : YAML::Node();
  const std::string own = name && name.IsScalar() ? name.Scalar() : "";
  if (!camera.empty() && camera != own)
    throw options::Error(fmt::format("{}: has no camera '{}' (`camera:`); it describes one camera{}",
                                     document.path, camera, own.empty() ? " without a name" : ", " + own));
  return kind == FileKind::kOcamCalib ? readOcamCalib(document) : readMatrixFile(document);
}

SensorFile readSensorFile(const std::string& path) {
  const Document document = readDocument(path);
  const FileKind kind = kindOf(document);
  if (kind == FileKind::kOwn) {
    const std::size_t begin = document.text.find_first_not_of(" \t\r\n");
    if (begin != std::string::npos && document.text[begin] == '<')
      throw options::Error(path +
                           ": this XML file has no camera_matrix; it is no calibration file of OpenCV");
    return {options::Section::parse(document.text, path), std::nullopt};
  }
  if (!document.isMap()) return {options::Section::parse("", path), readForeign(document, kind, "")};
  const options::Section own = ownSection(document, kind);
  if (own.has("calibration"))
    own.fail("calibration",
             "names another file, but this file has the keys of a calibration itself; remove one of them");
  std::string camera;
  own.read("camera", camera);
  const Document rest = kind == FileKind::kOther ? document : withoutOwnKeys(document, kind);
  return {own, readForeign(rest, kind, camera)};
}

ForeignLens readCalibrationFile(const options::Section& section, const std::string& name) {
  const auto path = (std::filesystem::path(section.file()).parent_path() / name).string();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    section.fail("calibration",
                 fmt::format("{}: no such file (the path is relative to the folder of this file)", path));
  const Document document = readDocument(path);
  if (!document.yaml_error.empty() && !isOcamCalib(document) && otherFormat(document).empty())
    throw options::Error(fmt::format("{}:{}", path, document.yaml_error));
  const FileKind kind = kindOf(document);
  if (kind == FileKind::kOwn)
    section.fail(
        "calibration",
        fmt::format(
            "{} has the structure of no known calibration file: OpenCV and ROS have camera_matrix (or K) "
            "and distortion_coefficients (or D), Kalibr has cam0, OCamCalib's calib_results.txt five "
            "lines of numbers",
            path));
  std::string camera;
  section.read("camera", camera);
  return readForeign(document, kind, camera);
}

}  // namespace omnifleet::lens
