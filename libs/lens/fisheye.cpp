#include <fmt/format.h>

#include <array>
#include <cmath>

#include "lens/models.h"
#include "lens/monotone.h"

namespace omnifleet::lens {
namespace {

/// ρ(θ) of the four closed-form projections.
class ClosedForm {
 public:
  explicit ClosedForm(Projection projection) : projection_(projection) {}

  double radius(double theta) const {
    switch (projection_) {
      case Projection::kOrthographic:
        return std::sin(theta);
      case Projection::kEquisolid:
        return 2.0 * std::sin(0.5 * theta);
      case Projection::kStereographic:
        return 2.0 * std::tan(0.5 * theta);
      default:
        return theta;
    }
  }
  double angle(double radius) const {
    switch (projection_) {
      case Projection::kOrthographic:
        return std::asin(radius);
      case Projection::kEquisolid:
        return 2.0 * std::asin(0.5 * radius);
      case Projection::kStereographic:
        return 2.0 * std::atan(0.5 * radius);
      default:
        return radius;
    }
  }
  /// End of the open interval on which ρ increases.
  double domain() const { return projection_ == Projection::kOrthographic ? 0.5 * M_PI : M_PI; }

 private:
  Projection projection_;
};

/// ρ(θ) = θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹.
class KannalaBrandt {
 public:
  explicit KannalaBrandt(const CameraModel& model) {
    for (std::size_t i = 0; i < model.distortion.size(); ++i) k_[i] = model.distortion[i];
    const double half = 0.5 * model.fov_deg * kDegree;
    const auto slope = [this](double theta) { return valueAndSlope(theta).second; };
    if (const auto broken = firstBreak(slope, half)) throw options::Error(breakMessage(model, *broken));
    end_ = half + kEdgeSlack_rad;
  }

  std::pair<double, double> valueAndSlope(double theta) const {
    const double t = theta * theta;
    const double value = theta * (1.0 + t * (k_[0] + t * (k_[1] + t * (k_[2] + t * k_[3]))));
    const double slope = 1.0 + t * (3.0 * k_[0] + t * (5.0 * k_[1] + t * (7.0 * k_[2] + t * 9.0 * k_[3])));
    return {value, slope};
  }
  double radius(double theta) const { return valueAndSlope(theta).first; }
  double angle(double radius) const {
    return solveIncreasing([this](double theta) { return valueAndSlope(theta); }, radius, 0.0, end_, radius);
  }
  double domain() const { return M_PI; }

 private:
  std::array<double, 4> k_{};
  double end_ = 0.0;
};

template <typename Profile>
class RadialLens : public Lens {
 public:
  RadialLens(const CameraModel& model, const Profile& profile)
      : focal_(model.focal_px),
        centre_(model.principal_point_px),
        skew_px_(model.skew_px),
        profile_(profile) {
    const double half = 0.5 * model.fov_deg * kDegree + kEdgeSlack_rad;
    open_ = half >= profile_.domain();
    end_rad_ = open_ ? profile_.domain() : half;
    end_radius_ = profile_.radius(end_rad_);
  }

  std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const override {
    const double side = std::hypot(ray.x(), ray.y());
    const double theta = std::atan2(side, ray.z());
    if (!within(theta, end_rad_) || !std::isfinite(side) || (side == 0.0 && !(ray.z() > 0.0)))
      return std::nullopt;
    const double scale = side > 0.0 ? profile_.radius(theta) / side : 0.0;
    Eigen::Vector2d pixel = centre_ + scale * focal_.cwiseProduct(ray.head<2>());
    pixel.x() += skew_px_ * (scale * ray.y());
    return pixel;
  }

  std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const override {
    Eigen::Vector2d m = (pixel - centre_).cwiseQuotient(focal_);
    m.x() -= skew_px_ / focal_.x() * m.y();
    const double radius = m.norm();
    if (!within(radius, end_radius_)) return std::nullopt;
    const double theta = profile_.angle(radius);
    const double scale = radius > 0.0 ? std::sin(theta) / radius : 1.0;
    return Eigen::Vector3d(scale * m.x(), scale * m.y(), std::cos(theta));
  }

 private:
  bool within(double value, double end) const { return open_ ? value < end : value <= end; }  // false for NaN

  Eigen::Vector2d focal_, centre_;
  double skew_px_ = 0.0;
  Profile profile_;
  bool open_ = false;  ///< the projection ends before the field of view
  double end_rad_ = 0.0, end_radius_ = 0.0;
};

}  // namespace

std::string breakMessage(const CameraModel& model, double break_rad) {
  return fmt::format(
      "distortion: the lens cannot be inverted beyond {:.2f}° from its axis; fov_deg {:g} needs {:g}°",
      break_rad / kDegree, model.fov_deg, 0.5 * model.fov_deg);
}

std::unique_ptr<const Lens> makeFisheye(const CameraModel& model) {
  if (model.projection == Projection::kKannalaBrandt) {
    return std::make_unique<RadialLens<KannalaBrandt>>(model, KannalaBrandt(model));
  }
  return std::make_unique<RadialLens<ClosedForm>>(model, ClosedForm(model.projection));
}

}  // namespace omnifleet::lens
