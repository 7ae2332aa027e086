#include "lens/camera.h"

#include <fmt/format.h>

#include <cmath>

#include "geometry/pose2.h"
#include "lens/models.h"

namespace omnifleet::lens {
namespace {

/// Rays whose z component (unit ray) is below this count as parallel to the floor.
constexpr double kHorizon = 1e-9;

void check(bool good, const std::string& problem) {
  if (!good) throw options::Error(problem);
}

/// Throws options::Error unless `distortion` has a number of values that the projection accepts.
void checkDistortion(const CameraModel& model) {
  const std::size_t n = model.distortion.size();
  for (const double value : model.distortion)
    check(std::isfinite(value), "distortion: must be finite numbers");
  switch (model.projection) {
    case Projection::kKannalaBrandt:
      check(n == 0 || n == 4,
            fmt::format("distortion: kannala_brandt needs 4 values (k1, k2, k3, k4) or none, got {}", n));
      return;
    case Projection::kOcam:
      check(n >= 5,
            fmt::format("distortion: ocam needs at least 5 values ([ss0, ss1, …, c, d, e]), got {}", n));
      return;
    case Projection::kPinhole:
      check(
          n == 0 || n == 4 || n == 5 || n == 8,
          fmt::format(
              "distortion: pinhole needs 0, 4, 5 (k1, k2, p1, p2, k3) or 8 values (with k4, k5, k6), got {}",
              n));
      return;
    default:
      for (const double value : model.distortion) {
        check(value == 0.0,
              "distortion: must be zero; only kannala_brandt, ocam and pinhole have distortion");
      }
  }
}

}  // namespace

std::unique_ptr<const Lens> Lens::make(const CameraModel& model) {
  check(model.image_width_px > 0 && model.image_height_px > 0, "image_width, image_height: must be positive");
  check(model.principal_point_px.allFinite(), "principal_point_px: must be finite numbers");
  const bool needs_focal =
      model.projection != Projection::kOcam || model.kind == CameraKind::kEquirectangular;
  check(!needs_focal || (model.focal_px.allFinite() && model.focal_px.minCoeff() > 0.0),
        "focal_px: must be positive");
  check(std::isfinite(model.skew_px), "skew_px: must be a finite number");
  check(model.skew_px == 0.0 ||
            (model.kind != CameraKind::kEquirectangular && model.projection != Projection::kOcam),
        "skew_px: only fisheye and pinhole lenses have it; ocam has c, d, e instead");
  if (model.kind == CameraKind::kEquirectangular) return makeEquirectangular(model);
  checkDistortion(model);
  if (model.projection == Projection::kPinhole) return makePinhole(model);
  check(model.fov_deg > 0.0 && model.fov_deg <= 360.0, "fov_deg: must be within (0, 360]");
  return model.projection == Projection::kOcam ? makeOcam(model) : makeFisheye(model);
}

Eigen::Isometry3d CameraModel::parentFromCamera() const {
  Eigen::Matrix3d r0;  // columns: image right, image down, optical axis
  r0 << 0, -1, 0,      //
      -1, 0, 0,        //
      0, 0, -1;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotationFromRpyDeg(rotation_rpy_deg) * r0;
  pose.translation() = position_m;
  return pose;
}

Camera::Camera(const CameraModel& model)
    : model_(model), lens_(Lens::make(model)), parent_from_camera_(model.parentFromCamera()) {}

std::optional<Eigen::Vector3d> Camera::rayFromPixel(const Eigen::Vector2d& pixel) const {
  const std::optional<Eigen::Vector3d> ray = lens_->rayFromPixel(pixel);
  if (!ray) return std::nullopt;
  return Eigen::Vector3d(parent_from_camera_.linear() * *ray);
}

std::optional<Eigen::Vector2d> Camera::planeFromPixel(const Eigen::Vector2d& pixel,
                                                      double plane_height_m) const {
  const std::optional<Eigen::Vector3d> ray = rayFromPixel(pixel);
  if (!ray || !(std::abs(ray->z()) > kHorizon)) return std::nullopt;
  const double along = (plane_height_m - model_.position_m.z()) / ray->z();
  if (!(along > 0.0)) return std::nullopt;
  return Eigen::Vector2d(model_.position_m.head<2>() + along * ray->head<2>());
}

std::optional<Eigen::Vector2d> Camera::pixelFromPoint(const Eigen::Vector3d& point_in_parent) const {
  return lens_->pixelFromRay(parent_from_camera_.linear().transpose() *
                             (point_in_parent - model_.position_m));
}

}  // namespace omnifleet::lens
