#include <cmath>

#include "lens/models.h"

namespace omnifleet::lens {
namespace {

class EquirectangularLens : public Lens {
 public:
  explicit EquirectangularLens(const CameraModel& model)
      : focal_(model.focal_px), centre_(model.principal_point_px) {}

  std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const override {
    const double flat = std::hypot(ray.x(), ray.z());
    if (!(ray.allFinite() && flat + std::abs(ray.y()) > 0.0)) return std::nullopt;
    const Eigen::Vector2d angles(std::atan2(ray.x(), ray.z()), std::atan2(ray.y(), flat));
    return Eigen::Vector2d(centre_ + focal_.cwiseProduct(angles));
  }

  std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const override {
    const Eigen::Vector2d angles = (pixel - centre_).cwiseQuotient(focal_);
    // The outer half of the border pixels lies up to half a pixel beyond ±180°.
    const double slack = 0.5 / focal_.x() + kEdgeSlack_rad;
    if (!(std::abs(angles.x()) <= M_PI + slack)) return std::nullopt;
    if (!(std::abs(angles.y()) <= 0.5 * M_PI + kEdgeSlack_rad)) return std::nullopt;
    const double flat = std::cos(angles.y());
    return Eigen::Vector3d(flat * std::sin(angles.x()), std::sin(angles.y()), flat * std::cos(angles.x()));
  }

 private:
  Eigen::Vector2d focal_, centre_;
};

}  // namespace

std::unique_ptr<const Lens> makeEquirectangular(const CameraModel& model) {
  return std::make_unique<EquirectangularLens>(model);
}

}  // namespace omnifleet::lens
