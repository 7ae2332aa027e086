#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "lens/camera.h"
#include "lens/foreign.h"
#include "lens/models.h"

namespace omnifleet::lens {
namespace {

constexpr double kWidest_deg = 359.0;

template <typename Enum>
struct Name {
  const char* name;
  Enum value;
};
constexpr std::array<Name<CameraKind>, 4> kKinds{{{"fisheye", CameraKind::kFisheye},
                                                  {"pinhole", CameraKind::kPinhole},
                                                  {"equirectangular", CameraKind::kEquirectangular},
                                                  {"catadioptric", CameraKind::kCatadioptric}}};
constexpr std::array<Name<Projection>, 7> kProjections{{{"orthographic", Projection::kOrthographic},
                                                        {"equidistant", Projection::kEquidistant},
                                                        {"equisolid", Projection::kEquisolid},
                                                        {"stereographic", Projection::kStereographic},
                                                        {"kannala_brandt", Projection::kKannalaBrandt},
                                                        {"ocam", Projection::kOcam},
                                                        {"pinhole", Projection::kPinhole}}};

template <typename Enum, std::size_t N>
std::string toText(Enum value, const std::array<Name<Enum>, N>& names) {
  const auto found =
      std::find_if(names.begin(), names.end(), [&](const auto& entry) { return entry.value == value; });
  return found == names.end() ? "" : found->name;
}

template <typename Enum, std::size_t N>
void readName(const options::Section& section, const std::string& key, const std::array<Name<Enum>, N>& names,
              Enum& value) {
  std::vector<std::string> allowed;
  for (const auto& entry : names) allowed.emplace_back(entry.name);
  std::string text = toText(value, names);
  section.read(key, text, allowed);
  for (const auto& entry : names) {
    if (text == entry.name) value = entry.value;
  }
}

/// Reads image size and lens model. They come from the section, or from a calibration file and the section.
void readImageAndModel(const options::Section& section, const std::optional<ForeignLens>& lens,
                       CameraModel& model) {
  const options::Range size{1, 32768};
  section.read("image_width", model.image_width_px, size);
  section.read("image_height", model.image_height_px, size);
  readName(section, "camera_model", kKinds, model.kind);
  if (!lens && model.kind == CameraKind::kPinhole) model.projection = Projection::kPinhole;
  if (!lens && model.kind == CameraKind::kCatadioptric) model.projection = Projection::kOcam;
  if (model.kind == CameraKind::kEquirectangular && !lens) {
    std::string ignored;
    section.read("projection", ignored);
  } else {
    if (!lens && model.kind == CameraKind::kFisheye && !section.has("projection"))
      section.fail("projection", "is required for a fisheye lens");
    readName(section, "projection", kProjections, model.projection);
  }
  if (lens) return applyForeign(section, *lens, model);
  if (model.image_width_px == 0) section.fail("image_width", "is required");
  if (model.image_height_px == 0) section.fail("image_height", "is required");
}

/// The lens of the file that `calibration:` names, if any.
std::optional<ForeignLens> readNamedCalibration(const options::Section& section) {
  std::string file;
  section.read("calibration", file);
  if (!file.empty()) return readCalibrationFile(section, file);
  if (section.has("camera"))
    section.fail("camera",
                 "chooses one of the cameras of a calibration file, but there is no `calibration:`");
  return std::nullopt;
}

// Values outside these ranges indicate a wrong unit.
constexpr options::Range kFocal_px{0.1, 1e6};
constexpr double kFarthest_m = 100.0;

void readFocal(const options::Section& section, Eigen::Vector2d& focal_px) {
  if (section.isList("focal_px")) {
    section.read("focal_px", focal_px, kFocal_px);
  } else if (section.has("focal_px")) {
    double value = 0.0;
    section.read("focal_px", value, kFocal_px);
    focal_px = {value, value};
  }
}

/// Fills keys that a sensor.yaml may omit; reports those it must not omit.
void fillDefaults(const options::Section& section, bool known_intrinsics, CameraModel& model) {
  if (model.kind == CameraKind::kEquirectangular) {
    if (!section.has("focal_px")) {
      model.focal_px = {model.image_width_px / (2.0 * M_PI), model.image_height_px / M_PI};
    }
    if (!section.has("principal_point_px")) {
      model.principal_point_px = {0.5 * (model.image_width_px - 1), 0.5 * (model.image_height_px - 1)};
    }
    return;
  }
  if (known_intrinsics) return;
  if (model.projection != Projection::kOcam && !section.has("focal_px"))
    section.fail("focal_px", "is required");
  if (!section.has("principal_point_px")) section.fail("principal_point_px", "is required");
}

/// The message of Lens::make begins with the key. This adds file and line: those of the calibration file,
/// unless the key stands in the section.
[[noreturn]] void failAtKey(const options::Section& section, const std::optional<ForeignLens>& lens,
                            const std::string& message) {
  const std::size_t colon = message.find(": ");
  const std::string key = colon == std::string::npos ? "distortion" : message.substr(0, colon);
  if (lens && !section.has(key)) throw options::Error(fmt::format("{}: {}", lens->path, message));
  section.fail(key, colon == std::string::npos ? message : message.substr(colon + 2));
}

void checkLens(const options::Section& section, const std::optional<ForeignLens>& lens, CameraModel& model) {
  if (model.projection == Projection::kStereographic && model.fov_deg > kWidest_deg)
    section.fail("fov_deg",
                 fmt::format("must be at most {:g}: a stereographic lens has no image at 180° from its axis "
                             "(r = 2 f tan θ/2)",
                             kWidest_deg));
  const bool has_field =
      model.kind != CameraKind::kEquirectangular && model.projection != Projection::kPinhole;
  const bool fov_is_stated = section.has("fov_deg");
  try {
    checkPlausibleNumbers(model);
    if (has_field && !fov_is_stated) model.fov_deg = widestFovDeg(model);
    Lens::make(model);
    checkPlausibleView(model, fov_is_stated);
  } catch (const options::Error& error) {
    failAtKey(section, lens, error.what());
  }
}

CameraModel readModel(const options::Section& section, const std::optional<ForeignLens>& lens) {
  CameraModel model;
  readImageAndModel(section, lens, model);
  readFocal(section, model.focal_px);
  section.read("principal_point_px", model.principal_point_px);
  section.read("skew_px", model.skew_px);
  section.read("fov_deg", model.fov_deg, {1.0, 360.0});
  section.read("distortion", model.distortion);
  section.read("position_m", model.position_m, {-kFarthest_m, kFarthest_m});
  section.read("rotation_rpy_deg", model.rotation_rpy_deg, {-360.0, 360.0});
  section.read("self_mask_radius_px", model.self_mask_radius_px, options::kNotNegative);
  section.read("reprojection_rms_px", model.reprojection_rms_px, options::kNotNegative);
  section.finish();
  fillDefaults(section, lens.has_value(), model);
  checkLens(section, lens, model);
  return model;
}

}  // namespace

CameraModel CameraModel::load(const std::string& path) {
  const SensorFile file = readSensorFile(path);
  return file.lens ? readModel(file.own, file.lens) : read(file.own);
}

CameraModel CameraModel::read(const options::Section& section) {
  return readModel(section, readNamedCalibration(section));
}

std::string CameraModel::toYaml() const {
  std::string text = fmt::format("camera_model: {}\n", toText(kind, kKinds));
  if (kind != CameraKind::kEquirectangular)
    text += fmt::format("projection: {}\n", toText(projection, kProjections));
  text += fmt::format("image_width: {}\nimage_height: {}\n", image_width_px, image_height_px);
  if (focal_px.minCoeff() > 0.0) text += fmt::format("focal_px: [{}, {}]\n", focal_px.x(), focal_px.y());
  text += fmt::format("principal_point_px: [{}, {}]\n", principal_point_px.x(), principal_point_px.y());
  if (skew_px != 0.0) text += fmt::format("skew_px: {}\n", skew_px);
  text += fmt::format("fov_deg: {}\ndistortion: [{}]\n", fov_deg, fmt::join(distortion, ", "));
  text += fmt::format("position_m: [{}, {}, {}]\n", position_m.x(), position_m.y(), position_m.z());
  text += fmt::format("rotation_rpy_deg: [{}, {}, {}]\n", rotation_rpy_deg.x(), rotation_rpy_deg.y(),
                      rotation_rpy_deg.z());
  text += fmt::format("self_mask_radius_px: {}\n", self_mask_radius_px);
  if (reprojection_rms_px > 0.0) text += fmt::format("reprojection_rms_px: {}\n", reprojection_rms_px);
  return text;
}

double widestFovDeg(CameraModel model) {
  const auto invertible = [&model](double fov_deg) {
    model.fov_deg = fov_deg;
    try {
      return Lens::make(model);
    } catch (const options::Error&) {
      return std::unique_ptr<const Lens>();
    }
  };
  double low = 1.0, high = model.projection == Projection::kOrthographic ? 180.0 : kWidest_deg;
  if (!invertible(high)) {
    if (!invertible(low)) Lens::make(model);  // throws the reason
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (low + high);
      (invertible(middle) ? low : high) = middle;
    }
    high = low;
  }
  const std::unique_ptr<const Lens> lens = invertible(high);
  double farthest_rad = 0.0;
  const double right = model.image_width_px - 1.0, bottom = model.image_height_px - 1.0;
  for (const Eigen::Vector2d& corner : {Eigen::Vector2d(0, 0), Eigen::Vector2d(right, 0),
                                        Eigen::Vector2d(0, bottom), Eigen::Vector2d(right, bottom)}) {
    const auto ray = lens->rayFromPixel(corner);
    if (!ray) return high;
    farthest_rad = std::max(farthest_rad, std::atan2(ray->head<2>().norm(), ray->z()));
  }
  return std::min(high, 2.0 * farthest_rad / kDegree);
}

}  // namespace omnifleet::lens
