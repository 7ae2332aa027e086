#include "local_mapper/lens_verdict.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "lens/models.h"

namespace omnifleet::local_mapper {
namespace {

constexpr int kAzimuths = 72;
constexpr double kCertain = 3.0;  // σ of the circle that count as possible

Eigen::Vector2d unitAt(int azimuth) {
  const double angle = 2.0 * M_PI * azimuth / kAzimuths;
  return {std::cos(angle), std::sin(angle)};
}

double middleOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The model with the widest field of view that it can be inverted over.
lens::CameraModel widened(lens::CameraModel model, double widest_deg) {
  model.fov_deg = std::max(model.fov_deg, widest_deg);
  return model;
}

Eigen::Vector3d rayAt(double theta, const Eigen::Vector2d& azimuth) {
  return {std::sin(theta) * azimuth.x(), std::sin(theta) * azimuth.y(), std::cos(theta)};
}

/// Angle to the axis of a pixel at or beyond the end of the model.
std::optional<double> continuedAngle(const lens::Lens& lens, const lens::CameraModel& model,
                                     const Eigen::Vector2d& from_axis_px) {
  constexpr double kSmall_rad = 1e-3, kInside = 1.0 - 1e-6;
  const Eigen::Vector2d azimuth = from_axis_px.normalized();
  const double half = 0.5 * model.fov_deg * lens::kDegree;
  const double end_rad =
      kInside * (model.projection == lens::Projection::kOrthographic ? std::min(half, 0.5 * M_PI) : half);
  const auto near = lens.pixelFromRay(rayAt(kSmall_rad, azimuth));
  const auto end = lens.pixelFromRay(rayAt(end_rad, azimuth));
  if (!near || !end) return std::nullopt;
  const double focal_px = (*near - model.principal_point_px).norm() / kSmall_rad;
  return end_rad + (from_axis_px.norm() - (*end - model.principal_point_px).norm()) / focal_px;
}

/// Radius at which the field of view of the model ends, seen from the principal point; 0 if that is outside
/// the image in most directions.
double statedRadius(const lens::CameraModel& model) {
  const auto lens = lens::Lens::make(model);
  const double longest_px = std::hypot(model.image_width_px, model.image_height_px);
  std::vector<double> radii;
  for (int i = 0; i < kAzimuths; ++i) {
    double inside = 0.0, outside = longest_px;
    if (lens->rayFromPixel(model.principal_point_px + outside * unitAt(i))) continue;
    while (outside - inside > 0.1) {
      const double middle = 0.5 * (inside + outside);
      (lens->rayFromPixel(model.principal_point_px + middle * unitAt(i)) ? inside : outside) = middle;
    }
    radii.push_back(inside);
  }
  return 2 * static_cast<int>(radii.size()) > kAzimuths ? middleOf(radii) : 0.0;
}

Contradiction contradictionOf(const LensVerdict& verdict, const lens::CameraModel& model,
                              const ImageCircleOptions& options) {
  const ImageCircle& circle = verdict.circle;
  if (verdict.centre_off_px > options.centre_tolerance * circle.radius_px + kCertain * circle.centre_sigma_px)
    return Contradiction::kCentre;
  const double largest_px = circle.radius_px + kCertain * circle.radius_sigma_px;
  if (verdict.states_view && largest_px < (1.0 - options.tolerance) * verdict.stated_px)
    return Contradiction::kStated;
  const double stated_deg = verdict.states_view ? (1.0 + options.tolerance) * model.fov_deg : 0.0;
  if (verdict.view_deg > std::max(options.widest_view_deg, stated_deg)) return Contradiction::kTooWide;
  if (!verdict.states_view && verdict.view_deg < options.narrowest_view_deg) return Contradiction::kTooNarrow;
  return Contradiction::kNone;
}

}  // namespace

double viewAtCircle(const ImageCircle& circle, const lens::CameraModel& model) {
  const lens::CameraModel wide = widened(model, lens::widestFovDeg(model));
  const auto lens = lens::Lens::make(wide);
  std::vector<double> angles;
  for (int i = 0; i < kAzimuths; ++i) {
    const Eigen::Vector2d pixel = circle.centre_px + circle.radius_px * unitAt(i);
    if (const auto ray = lens->rayFromPixel(pixel))
      angles.push_back(std::atan2(ray->head<2>().norm(), ray->z()));
    else if (const auto angle = continuedAngle(*lens, wide, pixel - wide.principal_point_px))
      angles.push_back(*angle);
  }
  return angles.empty() ? 0.0 : 2.0 * middleOf(angles) / lens::kDegree;
}

LensVerdict judgeLens(const ImageCircle& circle, const lens::CameraModel& model,
                      const ImageCircleOptions& options) {
  LensVerdict verdict;
  verdict.circle = circle;
  verdict.centre_off_px = (circle.centre_px - model.principal_point_px).norm();
  if (model.projection == lens::Projection::kPinhole || model.kind == lens::CameraKind::kEquirectangular) {
    verdict.contradiction = Contradiction::kNoEdge;
    return verdict;
  }
  constexpr double kSame_deg = 0.01;  // a recording writes fov_deg with all digits
  verdict.states_view = std::abs(model.fov_deg - lens::widestFovDeg(model)) > kSame_deg;
  if (verdict.states_view) verdict.stated_px = statedRadius(model);
  verdict.view_deg = viewAtCircle(circle, model);
  verdict.contradiction = contradictionOf(verdict, model, options);
  return verdict;
}

std::optional<LensVerdict> LensCheck::examine(const cv::Mat& image) {
  if (frames_ >= options_.frames || image.cols != model_.image_width_px ||
      image.rows != model_.image_height_px || (image.type() != CV_8UC3 && image.type() != CV_8UC1))
    return std::nullopt;
  ++frames_;
  const auto circle = findImageCircle(image, options_);
  if (!circle) return std::nullopt;
  frames_ = options_.frames;
  return judgeLens(*circle, model_, options_);
}

}  // namespace omnifleet::local_mapper
