// A lens that can be computed, but makes no sense for its image: wrong units, wrong order, a polynomial that
// ends.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "lens/foreign.h"
#include "lens/models.h"

namespace omnifleet::lens {
namespace {

[[noreturn]] void implausible(const std::string& text) {
  throw options::Error(text);
}

void checkNumbers(const CameraModel& model) {
  const double w = model.image_width_px, h = model.image_height_px;
  const Eigen::Vector2d c = model.principal_point_px;
  if (!(c.x() > -0.5 && c.x() < w && c.y() > -0.5 && c.y() < h))
    implausible(fmt::format("principal_point_px: ({:g}, {:g}) lies outside the image of {:g}×{:g} px", c.x(),
                            c.y(), w, h));
  if (model.projection == Projection::kOcam) return;
  const double ratio = model.focal_px.x() / model.focal_px.y();
  if (ratio > 3.0 || ratio < 1.0 / 3.0)
    implausible(fmt::format("focal_px: fx = {:g} and fy = {:g} differ by more than a factor of 3",
                            model.focal_px.x(), model.focal_px.y()));
  if (std::abs(model.skew_px) > 0.2 * model.focal_px.x())
    implausible(fmt::format("skew_px: {:g} px is more than a fifth of the focal length of {:g} px",
                            model.skew_px, model.focal_px.x()));
}

constexpr const char* kOcamOrder = "distortion: [ss0, ss1, ss2, ss3, ss4, c, d, e] of ocam: ";

/// OCamCalib holds ss1 at 0; c, d, e are near 1, 0, 0; ss0 is the focal length in pixels.
void checkOcam(const CameraModel& model) {
  const std::vector<double>& k = model.distortion;
  if (k.size() < 5) return;  // Lens::make reports it
  const double w = model.image_width_px, h = model.image_height_px, size = std::hypot(w, h);
  const double c = k[k.size() - 3], d = k[k.size() - 2], e = k[k.size() - 1];
  constexpr double kFarthestScale = 1.25, kMostShear = 0.1;
  if (c < 1.0 / kFarthestScale || c > kFarthestScale || std::abs(d) > kMostShear || std::abs(e) > kMostShear)
    implausible(fmt::format(
        "{}the last three values ({:g}, {:g}, {:g}) are c, d, e and must be near 1, 0, 0; are they "
        "missing?",
        kOcamOrder, c, d, e));
  if (!(k[0] < 0.0))
    implausible(
        fmt::format("{}ss0 must be negative, but is {:g} (OCamCalib's sign; negate the whole polynomial)",
                    kOcamOrder, k[0]));
  if (-k[0] < 0.02 * size || -k[0] > 20.0 * size)
    implausible(
        fmt::format("{}ss0 is {:g} px, which is no focal length of an image of {:g}×{:g} px; is the order "
                    "reversed?",
                    kOcamOrder, k[0], w, h));
  if (k.size() > 4 && k[1] != 0.0)
    implausible(fmt::format(
        "{}ss1 is {:g}, but must be 0; MATLAB's MappingCoefficients [a0 a2 a3 a4] leave it out: insert "
        "0 after a0",
        kOcamOrder, k[1]));
  const Eigen::Vector2d middle(0.5 * (w - 1.0), 0.5 * (h - 1.0)), at = model.principal_point_px;
  const double distance = (at - middle).norm();
  const double swapped = (Eigen::Vector2d(at.y(), at.x()) - middle).norm();
  if (distance > 0.05 * size && swapped < 0.25 * distance)
    implausible(fmt::format(
        "principal_point_px: [column {:g}, row {:g}] is far from the middle of an image {:g} px wide and "
        "{:g} px high; either width and height are exchanged (OCamCalib writes height first), or column and "
        "row (OCamCalib writes row first). Compare with the size of your images",
        at.x(), at.y(), w, h));
}

/// Distance from the principal point to the nearest border of the image.
double nearestBorderPx(const CameraModel& model) {
  const Eigen::Vector2d c = model.principal_point_px;
  return std::min({c.x(), c.y(), model.image_width_px - 1.0 - c.x(), model.image_height_px - 1.0 - c.y()});
}

/// Radius of the image circle at an angle from the axis, along image right and image down the smaller one.
double radiusPx(const CameraModel& model, const Lens& lens, double theta) {
  double smallest = 1e300;
  for (const double azimuth : {0.0, 0.5 * M_PI, M_PI, 1.5 * M_PI}) {
    const auto pixel = lens.pixelFromRay(
        {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)});
    if (pixel) smallest = std::min(smallest, (*pixel - model.principal_point_px).norm());
  }
  return smallest;
}

void checkCircle(const CameraModel& model, const Lens& lens, bool fov_is_stated) {
  constexpr double kNarrowest_deg = 80.0, kSmallest = 0.15;
  const double half_deg = 0.5 * model.fov_deg;
  const double end_deg = model.projection == Projection::kOrthographic ? std::min(half_deg, 89.9) : half_deg;
  const double radius_px = radiusPx(model, lens, end_deg * (1.0 - 1e-9) * kDegree);
  const double border_px = nearestBorderPx(model);
  const char* key = model.projection == Projection::kOcam || !fov_is_stated ? "distortion" : "focal_px";
  if (radius_px < kSmallest * border_px && half_deg > 30.0)
    implausible(fmt::format(
        "{}: the image circle of this lens has a radius of {:.1f} px only, but the image has {}×{} px; "
        "focal_px is in pixels, not in millimetres",
        key, radius_px, model.image_width_px, model.image_height_px));
  if (!fov_is_stated && half_deg < kNarrowest_deg && radius_px < border_px - 1.0)
    implausible(fmt::format(
        "distortion: the lens cannot be inverted beyond {:.1f}° from its axis ({:.0f} px), but "
        "the image reaches {:.0f} px; the model or the order of the values is wrong. If the image circle "
        "ends there, state fov_deg: {:.0f}",
        half_deg, radius_px, border_px, std::floor(model.fov_deg)));
}

/// Unit mistakes: the whole image would show less than a few degrees.
void checkNarrow(const CameraModel& model, const Lens& lens) {
  const double narrowest_deg = model.projection == Projection::kPinhole ? 1.0 : 5.0;
  double widest = 0.0;
  for (const double x : {0.0, model.image_width_px - 1.0}) {
    for (const double y : {0.0, model.image_height_px - 1.0}) {
      const auto ray = lens.rayFromPixel({x, y});
      if (!ray) return;
      widest = std::max(widest, std::atan2(ray->head<2>().norm(), ray->z()) / kDegree);
    }
  }
  if (widest < narrowest_deg)
    implausible(fmt::format(
        "{}: the corners of the image lie only {:.2f}° from the axis; is the focal length in pixels of "
        "this image size ({}×{})?",
        model.projection == Projection::kOcam ? "distortion" : "focal_px", widest, model.image_width_px,
        model.image_height_px));
}

}  // namespace

void checkPlausibleNumbers(const CameraModel& model) {
  if (model.kind == CameraKind::kEquirectangular) return;
  checkNumbers(model);
  if (model.projection == Projection::kOcam) checkOcam(model);
}

void checkPlausibleView(const CameraModel& model, bool fov_is_stated) {
  if (model.kind == CameraKind::kEquirectangular) return;
  const auto lens = Lens::make(model);
  if (model.projection != Projection::kPinhole) checkCircle(model, *lens, fov_is_stated);
  checkNarrow(model, *lens);
}

}  // namespace omnifleet::lens
