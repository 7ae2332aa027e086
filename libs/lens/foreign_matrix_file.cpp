// Files of OpenCV and ROS: a camera matrix and its distortion under the keys of either program.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "lens/foreign.h"

namespace omnifleet::lens {
namespace {

/// Keys by their normalized spelling.
const std::map<std::string, std::vector<std::string>> kUsed{
    {"camera_matrix", {"cameramatrix", "k", "mtx", "intrinsicmatrix", "intrinsics"}},
    {"distortion_coefficients",
     {"distortioncoefficients", "distortioncoeffs", "distcoeffs", "distcoefs", "dist", "d", "distortion",
      "distortionvector"}},
    {"image_width", {"imagewidth", "width", "imgwidth"}},
    {"image_height", {"imageheight", "height", "imgheight"}},
    {"image_size", {"imagesize", "resolution"}},
    {"fisheye_model", {"fisheyemodel", "fisheye", "isfisheye"}},
    {"distortion_model", {"distortionmodel", "distortiontype"}},
    {"camera_model", {"cameramodel"}},
    {"projection", {"projection"}},
    {"rectification_matrix", {"rectificationmatrix", "r"}},
    {"alpha", {"alpha"}},
    {"xi", {"xi"}},
    {"binning", {"binningx", "binningy"}},
    {"roi", {"roi"}}};

/// Keys that do not change the lens of a raw image.
const std::vector<std::string> kIrrelevant{
    // OpenCV's calibration programs
    "calibrationtime", "calibrationdate", "nrofframes", "nframes", "boardwidth", "boardheight", "boardsize",
    "squaresize", "markersize", "markerlength", "squarelength", "dictionary", "fixaspectratio", "aspectratio",
    "flags", "flagvalue", "avgreprojectionerror", "perviewreprojectionerrors", "perviewerrors", "rms",
    "reprojectionerror", "reprojectionrmspx", "extrinsicparameters", "imagepoints", "gridpoints", "rvecs",
    "tvecs", "stddeviations", "releaseobject", "gridwidth", "imagelist", "date",
    // ROS: the name, the message's header, and the matrix of the rectified image
    "cameraname", "header", "projectionmatrix", "p"};

std::string usedName(const std::string& key) {
  const std::string plain = normalized(key);
  for (const auto& [name, spellings] : kUsed) {
    if (std::find(spellings.begin(), spellings.end(), plain) != spellings.end()) return name;
  }
  return {};
}

bool isIrrelevant(const std::string& key) {
  return std::find(kIrrelevant.begin(), kIrrelevant.end(), normalized(key)) != kIrrelevant.end();
}

[[noreturn]] void failAt(const Document& document, const YAML::Node& node, const std::string& key,
                         const std::string& problem) {
  throw options::Error(fmt::format("{}: {}: {}", document.place(node), key, problem));
}

class MatrixFile {
 public:
  explicit MatrixFile(const Document& document) : document_(document) {
    lens_.path = document.path;
    for (const auto& entry : document.root) add(entry.first.Scalar(), entry.second);
    lens_.format = has("distortion_model") || document.root["camera_name"] ? "ROS camera_info" : "OpenCV";
  }

  ForeignLens read() {
    rejectOmnidir();
    readMatrix();
    readSize();
    if (has("distortion_coefficients")) lens_.distortion = values("distortion_coefficients");
    readFamily();
    readAlpha();
    checkRectification();
    checkBinning();
    return lens_;
  }

 private:
  struct Entry {
    std::string key;
    YAML::Node node;
  };

  void add(const std::string& key, const YAML::Node& node) {
    const std::string name = usedName(key);
    if (name.empty() && isIrrelevant(key)) return;
    if (name.empty()) {
      failAt(document_, node, key,
             isOwnKey(key, node) ? "is a key of sensor.yaml; write it there, beside `calibration:`"
                                 : "unknown key in a calibration file of OpenCV or ROS; if it changes the "
                                   "lens, calibrate without "
                                   "it; otherwise delete it");
    }
    const bool may_repeat = name == "binning";
    if (!may_repeat && entries_.count(name))
      failAt(document_, node, key,
             fmt::format("means the same as {} in this file; keep one of them", entries_.at(name).key));
    entries_[may_repeat ? key : name] = {key, node};
  }
  bool has(const std::string& name) const { return entries_.count(name) > 0; }
  const Entry& at(const std::string& name) const { return entries_.at(name); }
  std::vector<double> values(const std::string& name) const {
    return numbersOf(document_, at(name).node, at(name).key);
  }
  [[noreturn]] void fail(const std::string& name, const std::string& problem) const {
    failAt(document_, at(name).node, at(name).key, problem);
  }

  void rejectOmnidir() const {
    if (!has("xi")) return;
    fail("xi",
         "this is a lens of cv::omnidir (Mei's model), which is not supported; calibrate the lens again with "
         "scripts/calibrate.sh --projection ocam");
  }

  void readMatrix() {
    if (!has("camera_matrix"))
      throw options::Error(fmt::format(
          "{}: camera_matrix: is missing; the file has a distortion, but no camera matrix", document_.path));
    const std::vector<double> k = values("camera_matrix");
    if (k.size() != 9) fail("camera_matrix", fmt::format("must be 3×3, has {} numbers", k.size()));
    if (k[2] == 0.0 && k[5] == 0.0 && (k[6] != 0.0 || k[7] != 0.0))
      fail("camera_matrix", "is transposed (MATLAB's order); write [fx 0 cx; 0 fy cy; 0 0 1]");
    if (k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0)
      fail("camera_matrix", "must have the form [fx skew cx; 0 fy cy; 0 0 1]");
    lens_.focal_px = {k[0], k[4]};
    lens_.principal_point_px = {k[2], k[5]};
    lens_.skew_px = k[1];
  }

  int pixels(const std::string& name, double value) const {
    if (!(value >= 1.0 && value <= 32768.0 && value == std::floor(value)))
      fail(name, fmt::format("{:g} must be a whole number of pixels within [1, 32768]", value));
    return static_cast<int>(value);
  }
  double number(const std::string& name) const {
    try {
      return at(name).node.as<double>();
    } catch (const YAML::Exception&) {
      fail(name, "expected a number");
    }
  }

  void readSize() {
    if (has("image_width")) lens_.width_px = pixels("image_width", number("image_width"));
    if (has("image_height")) lens_.height_px = pixels("image_height", number("image_height"));
    if (!has("image_size")) return;
    const YAML::Node& node = at("image_size").node;
    const bool named = node.IsMap() && node["width"] && node["height"];
    std::vector<double> size;
    if (named)
      size = {node["width"].as<double>(0.0), node["height"].as<double>(0.0)};
    else
      size = values("image_size");
    if (size.size() != 2) fail("image_size", "must be [width, height]");
    const int width = pixels("image_size", size[0]), height = pixels("image_size", size[1]);
    if ((has("image_width") && lens_.width_px != width) || (has("image_height") && lens_.height_px != height))
      fail("image_size", "contradicts image_width and image_height");
    lens_.width_px = width;
    lens_.height_px = height;
  }

  /// Records that the file states a model. Two statements must agree.
  void state(Family family, const std::string& name) {
    const std::string by =
        fmt::format("{}: {}", at(name).key, at(name).node.IsScalar() ? at(name).node.Scalar() : "…");
    if (lens_.family && *lens_.family != family)
      fail(name, fmt::format("contradicts `{}` in this file; correct the wrong one", lens_.stated_by));
    lens_.family = family;
    lens_.stated_by = by;
  }

  void stateByName(const std::string& name) {
    if (!has(name)) return;
    const std::string text = textOf(document_, at(name).node, at(name).key);
    const auto family = familyFromName(text);
    if (!family) failUnknownModel(document_.place(at(name).node), at(name).key, text);
    state(*family, name);
  }

  void readFamily() {
    if (has("fisheye_model")) {
      const std::string text =
          normalized(textOf(document_, at("fisheye_model").node, at("fisheye_model").key));
      const bool yes = text == "1" || text == "true" || text == "yes";
      if (!yes && text != "0" && text != "false" && text != "no") fail("fisheye_model", "must be 1 or 0");
      state(yes ? Family::kFisheye : Family::kPinhole, "fisheye_model");
    }
    stateByName("distortion_model");
    stateByName("camera_model");
    stateByName("projection");
    const std::size_t n = lens_.distortion.size();
    if (!lens_.family &&
        (n == 5 || n == 8 || n == 12 || n == 14)) {  // counts of OpenCV's pinhole model alone
      lens_.family = Family::kPinhole;
      lens_.stated_by = fmt::format("{} with {} values", at("distortion_coefficients").key, n);
    }
  }

  /// cv::fisheye: alpha = skew / fx.
  void readAlpha() {
    if (!has("alpha")) return;
    const double skew_px = number("alpha") * lens_.focal_px.x();
    if (lens_.skew_px != 0.0 && std::abs(lens_.skew_px - skew_px) > 1e-6 * lens_.focal_px.x())
      fail("alpha", "contradicts the skew K[0][1] of the camera matrix (alpha = K[0][1] / K[0][0])");
    lens_.skew_px = skew_px;
  }

  void checkRectification() const {
    if (!has("rectification_matrix")) return;
    const std::vector<double> r = values("rectification_matrix");
    constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};
    bool good = r.size() == 9;
    for (std::size_t i = 0; good && i < 9; ++i) good = std::abs(r[i] - kIdentity[i]) < 1e-6;
    if (!good)
      fail("rectification_matrix",
           "is not the identity: the file is for the rectified images of a stereo pair. The cameras of a "
           "fleet "
           "deliver raw images: set the matrix to the identity, and give the mounting by rotation_rpy_deg");
  }

  void checkBinning() const {
    for (const auto& [name, entry] : entries_) {
      if (usedName(entry.key) != "binning") continue;
      if (entry.node.as<double>(0.0) > 1.0)
        fail(name, "the images are binned; calibrate with the images that the fleet uses");
    }
    if (!has("roi")) return;
    const YAML::Node& roi = at("roi").node;
    for (const char* key : {"x_offset", "y_offset"}) {
      if (roi.IsMap() && roi[key].IsDefined() && roi[key].as<double>(0.0) != 0.0)
        fail("roi", "the images are cut; calibrate with the images that the fleet uses");
    }
  }

  const Document& document_;
  std::map<std::string, Entry> entries_;
  ForeignLens lens_;
};

}  // namespace

bool isMatrixFile(const Document& document) {
  if (!document.isMap()) return false;
  bool matrix = false;
  for (const auto& entry : document.root) {
    if (!entry.first.IsScalar()) continue;
    const std::string name = usedName(entry.first.Scalar());
    const bool is_list = entry.second.IsMap() || entry.second.IsSequence();
    if (name == "camera_matrix") matrix = matrix || is_list;
    if (name == "distortion_coefficients")
      matrix = matrix || (is_list && !isOwnKey(entry.first.Scalar(), entry.second));
    if (name == "fisheye_model" || name == "distortion_model") matrix = true;
  }
  return matrix;
}

ForeignLens readMatrixFile(const Document& document) {
  return MatrixFile(document).read();
}

}  // namespace omnifleet::lens
