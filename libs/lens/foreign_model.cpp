// From what a calibration file says to a CameraModel. The lens model comes from the file or from the user.
#include <fmt/format.h>

#include <algorithm>

#include "lens/foreign.h"
#include "lens/models.h"

namespace omnifleet::lens {
namespace {

[[noreturn]] void failInFile(const ForeignLens& lens, const std::string& problem) {
  throw options::Error(fmt::format("{}: {}", lens.path, problem));
}

void applySize(const options::Section& section, const ForeignLens& lens, CameraModel& model) {
  const auto check = [&](const char* key, int from_file, int& value) {
    if (from_file > 0 && section.has(key) && value != from_file)
      section.fail(
          key, fmt::format("{} contradicts {}, which is for {}×{} px; a calibration holds for one image size",
                           value, lens.path, lens.width_px, lens.height_px));
    if (from_file > 0) value = from_file;
    if (value == 0)
      failInFile(
          lens, fmt::format("does not state the image size; add {} to the sensor.yaml, beside `calibration:`",
                            key));
  };
  check("image_width", lens.width_px, model.image_width_px);
  check("image_height", lens.height_px, model.image_height_px);
}

Family familyOf(Projection projection) {
  if (projection == Projection::kPinhole) return Family::kPinhole;
  return projection == Projection::kOcam ? Family::kOcam : Family::kFisheye;
}

bool kindFits(CameraKind kind, Family family) {
  if (kind == CameraKind::kPinhole) return family == Family::kPinhole;
  if (kind == CameraKind::kCatadioptric) return family == Family::kOcam;
  return kind == CameraKind::kFisheye && family != Family::kPinhole;
}

/// The family that the file states, or else the user.
Family statedFamily(const options::Section& section, const ForeignLens& lens, const CameraModel& said) {
  if (lens.family) return *lens.family;
  if (section.has("projection")) return familyOf(said.projection);
  if (!section.has("camera_model"))
    failInFile(
        lens,
        fmt::format("{} file that states no lens model. State it in the sensor.yaml, beside `calibration:`: "
                    "`camera_model: fisheye` for cv::fisheye (k1, k2, k3, k4), `camera_model: pinhole` for "
                    "cv::calibrateCamera (k1, k2, p1, p2, …); or in this file: `fisheye_model: 1` or 0",
                    lens.format));
  return said.kind == CameraKind::kPinhole ? Family::kPinhole : Family::kFisheye;
}

bool isIdeal(const ForeignLens& lens) {
  return std::all_of(lens.distortion.begin(), lens.distortion.end(), [](double k) { return k == 0.0; });
}

/// Chooses kind and projection; throws if file and user contradict each other.
void chooseModel(const options::Section& section, const ForeignLens& lens, CameraModel& model) {
  const Family family = statedFamily(section, lens, model);
  const std::string states =
      lens.family ? fmt::format("{} states {} ({})", lens.path, familyName(family), lens.stated_by)
                  : fmt::format("projection states {}", familyName(family));
  if (section.has("camera_model") && !kindFits(model.kind, family))
    section.fail("camera_model",
                 fmt::format("contradicts the calibration: {}; correct the wrong one", states));
  const bool equidistant = family == Family::kFisheye && isIdeal(lens) &&
                           (!lens.family || model.projection == Projection::kEquidistant);
  if (section.has("projection")) {
    const bool fits =
        familyOf(model.projection) == family &&
        (family != Family::kFisheye || equidistant || model.projection == Projection::kKannalaBrandt);
    if (!fits)
      section.fail("projection", fmt::format("contradicts the calibration: {}; {}", states,
                                             family == Family::kFisheye
                                                 ? "the fisheye model of such files is kannala_brandt"
                                                 : "correct the wrong one"));
  } else {
    model.projection = family == Family::kPinhole ? Projection::kPinhole
                       : family == Family::kOcam  ? Projection::kOcam
                                                  : Projection::kKannalaBrandt;
  }
  if (!section.has("camera_model"))
    model.kind = family == Family::kPinhole ? CameraKind::kPinhole : CameraKind::kFisheye;
}

/// A fisheye lens without coefficients would be an ideal one, which the file does not say.
void requireDistortion(const options::Section& section, const ForeignLens& lens, const CameraModel& model) {
  const bool is_ideal = section.has("projection") && model.projection == Projection::kEquidistant;
  if (familyOf(model.projection) != Family::kFisheye || !lens.distortion.empty() || is_ideal ||
      section.has("distortion"))
    return;
  failInFile(
      lens,
      "has no distortion coefficients, but a fisheye lens needs k1, k2, k3, k4: add "
      "`distortion_coefficients` to this file; for an ideal lens state `projection: equidistant` in the "
      "sensor.yaml");
}

/// The distortion in the order and number of the lens model.
std::vector<double> distortionFor(const ForeignLens& lens, const CameraModel& model) {
  std::vector<double> d = lens.distortion;
  if (model.projection == Projection::kOcam) return d;
  const bool fisheye = model.projection != Projection::kPinhole;
  const std::size_t most = fisheye ? 4 : 8;
  while (d.size() > most && d.back() == 0.0) d.pop_back();
  const std::size_t n = d.size();
  const bool good = fisheye ? n == 0 || n == 4 : n == 0 || n == 4 || n == 5 || n == 8;
  if (!good && fisheye)
    failInFile(
        lens,
        fmt::format("has {} distortion coefficients, but the fisheye model has 4 (k1, k2, k3, k4); the lens "
                    "model or the file is wrong",
                    n));
  if (!good && n > 8)
    failInFile(
        lens,
        "thin prism and tilt (distortion coefficients 9 to 14) are not supported; calibrate again without "
        "CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL");
  if (!good)
    failInFile(
        lens,
        fmt::format("has {} distortion coefficients, but the pinhole model has 4, 5 or 8 (k1, k2, p1, p2[, "
                    "k3[, k4, k5, k6]])",
                    n));
  if (fisheye && model.projection != Projection::kKannalaBrandt) d.clear();
  return d;
}

}  // namespace

void applyForeign(const options::Section& section, const ForeignLens& lens, CameraModel& model) {
  if (section.has("camera_model") && model.kind == CameraKind::kEquirectangular)
    section.fail("camera_model", "an equirectangular camera has no calibration file; remove one of them");
  applySize(section, lens, model);
  chooseModel(section, lens, model);
  requireDistortion(section, lens, model);
  model.focal_px = lens.focal_px;
  model.principal_point_px = lens.principal_point_px;
  model.skew_px = lens.skew_px;
  model.distortion = distortionFor(lens, model);
}

}  // namespace omnifleet::lens
