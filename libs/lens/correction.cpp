#include "lens/correction.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace omnifleet::lens {
namespace {

struct FloorPixel {
  Eigen::Vector2d pixel, floor_m;
};

std::vector<FloorPixel> floorPixels(const Camera& sensor, double range_m) {
  constexpr int kBearings = 24, kRanges = 40;
  std::vector<FloorPixel> all;
  for (int i = 0; i < kBearings; ++i) {
    const double phi = 2.0 * M_PI * i / kBearings;
    for (int k = 1; k <= kRanges; ++k) {
      const double range = range_m * k / kRanges;
      const Eigen::Vector2d floor = sensor.foot() + range * Eigen::Vector2d(std::cos(phi), std::sin(phi));
      const auto pixel = sensor.pixelFromPoint({floor.x(), floor.y(), 0.0});
      if (pixel) all.push_back({*pixel, floor});
    }
  }
  return all;
}

Camera hemisphere(const Camera& sensor, double focal_px) {
  CameraModel model = sensor.model();
  model.kind = CameraKind::kFisheye;
  model.projection = Projection::kOrthographic;
  model.focal_px = {focal_px, focal_px};
  model.skew_px = 0.0;
  model.fov_deg = std::min(model.fov_deg, 180.0);
  model.distortion.clear();
  return Camera(model);
}

double misfit(const Camera& sensor, double focal_px, const std::vector<FloorPixel>& pixels, double range_m) {
  const Camera camera = hemisphere(sensor, focal_px);
  double sum = 0.0;
  for (const FloorPixel& p : pixels) {
    const auto floor = camera.floorFromPixel(p.pixel);
    sum += floor ? std::min((*floor - p.floor_m).squaredNorm(), range_m * range_m) : range_m * range_m;
  }
  return sum;
}

}  // namespace

CorrectionOptions CorrectionOptions::read(const options::Section& section) {
  CorrectionOptions o;
  section.read("projection", o.projection, std::vector<std::string>{"sensor", "orthographic"});
  section.read("focal_px", o.focal_px, options::kNotNegative);
  section.read("fit_range_m", o.fit_range_m, {0.05, 100.0});
  section.finish();
  return o;
}

double fittedFocalPx(const Camera& sensor, double range_m) {
  const auto pixels = floorPixels(sensor, range_m);
  if (pixels.empty())
    throw options::Error(
        "camera: sees no floor, so eq. 6-7 cannot be fitted; check position_m and rotation_rpy_deg");
  double farthest = 1.0;
  for (const FloorPixel& p : pixels)
    farthest = std::max(farthest, (p.pixel - sensor.model().principal_point_px).norm());
  const auto at = [&](double focal) { return misfit(sensor, focal, pixels, range_m); };
  // The misfit has several minima where points drop out. So a coarse search comes first, then ternary search.
  constexpr int kSteps = 120;
  const double low = 0.25 * farthest, ratio = std::pow(16.0, 1.0 / kSteps);
  int best = 0;
  for (int i = 1; i <= kSteps; ++i) {
    if (at(low * std::pow(ratio, i)) < at(low * std::pow(ratio, best))) best = i;
  }
  double begin = low * std::pow(ratio, best - 1), end = low * std::pow(ratio, best + 1);
  for (int i = 0; i < 40; ++i) {
    const double a = begin + (end - begin) / 3.0, b = end - (end - begin) / 3.0;
    (at(a) <= at(b) ? end : begin) = at(a) <= at(b) ? b : a;
  }
  return 0.5 * (begin + end);
}

Camera correctionCamera(const Camera& sensor, const CorrectionOptions& options) {
  if (options.projection == "sensor") return sensor;
  return hemisphere(sensor,
                    options.focal_px > 0.0 ? options.focal_px : fittedFocalPx(sensor, options.fit_range_m));
}

}  // namespace omnifleet::lens
