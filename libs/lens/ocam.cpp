#include <fmt/format.h>

#include <cmath>

#include "lens/models.h"
#include "lens/monotone.h"

namespace omnifleet::lens {
namespace {

/// Optical frame of this project: x right (columns), y down (rows), z forward. OCamCalib: x along rows, y
/// along columns, z backward. Hence the swap and the sign of the polynomial.
class OcamLens : public Lens {
 public:
  explicit OcamLens(const CameraModel& model) : centre_(model.principal_point_px) {
    const std::vector<double>& d = model.distortion;
    z_.assign(d.begin(), d.end() - 3);
    for (double& coefficient : z_) coefficient = -coefficient;
    affine_ << d[d.size() - 3], d[d.size() - 2], d[d.size() - 1], 1.0;
    if (!(affine_.determinant() > 0.0)) throw options::Error("distortion: ocam: c − d·e must be positive");
    if (!(z_[0] > 0.0)) {
      throw options::Error(
          "distortion: ocam: ss0 must be negative (OCamCalib's sign; negate the whole polynomial)");
    }
    inverse_ = affine_.inverse();
    findEnd(model);
  }

  std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const override {
    const double side = std::hypot(ray.x(), ray.y());
    const double theta = std::atan2(side, ray.z());
    if (!(theta <= end_rad_) || !std::isfinite(side) || (side == 0.0 && !(ray.z() > 0.0)))
      return std::nullopt;
    const double rho = solveIncreasing([this](double r) { return angleAndSlope(r); }, theta, 0.0, end_radius_,
                                       end_radius_ * theta / end_rad_);
    const double scale = side > 0.0 ? rho / side : 0.0;
    const Eigen::Vector2d row_column = affine_ * Eigen::Vector2d(scale * ray.y(), scale * ray.x());
    return Eigen::Vector2d(centre_.x() + row_column.y(), centre_.y() + row_column.x());
  }

  std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const override {
    const Eigen::Vector2d p = inverse_ * Eigen::Vector2d(pixel.y() - centre_.y(), pixel.x() - centre_.x());
    const double rho = p.norm();
    if (!(rho <= end_radius_)) return std::nullopt;
    return Eigen::Vector3d(p.y(), p.x(), depth(rho).first).normalized();
  }

 private:
  /// z(ρ) and z'(ρ).
  std::pair<double, double> depth(double rho) const {
    double value = 0.0, slope = 0.0;
    for (std::size_t i = z_.size(); i-- > 0;) {
      slope = slope * rho + value;
      value = value * rho + z_[i];
    }
    return {value, slope};
  }
  /// θ(ρ) = atan2(ρ, z(ρ)) and its derivative (z − ρ z') / (ρ² + z²).
  std::pair<double, double> angleAndSlope(double rho) const {
    const auto [z, slope] = depth(rho);
    return {std::atan2(rho, z), (z - rho * slope) / (rho * rho + z * z)};
  }

  /// Finds the radius where θ(ρ) reaches the edge of the field of view. Throws if θ stops increasing before.
  void findEnd(const CameraModel& model) {
    end_rad_ = 0.5 * model.fov_deg * kDegree + kEdgeSlack_rad;
    const double limit = 4.0 * std::hypot(model.image_width_px, model.image_height_px) + 4.0 * z_[0];
    const auto slope = [this](double rho) { return angleAndSlope(rho).second; };
    const auto broken = firstBreak(slope, limit, 16000);
    const double high = broken ? *broken : limit;
    const double reached = angleAndSlope(high).first;
    if (!(reached >= end_rad_)) throw options::Error(breakMessage(model, reached));
    end_radius_ =
        solveIncreasing([this](double r) { return angleAndSlope(r); }, end_rad_, 0.0, high, 0.5 * high);
  }

  Eigen::Vector2d centre_;
  std::vector<double> z_;  ///< z(ρ) = Σ z_i ρ^i, pixels, z forward
  Eigen::Matrix2d affine_, inverse_;
  double end_rad_ = 0.0, end_radius_ = 0.0;
};

}  // namespace

std::unique_ptr<const Lens> makeOcam(const CameraModel& model) {
  return std::make_unique<OcamLens>(model);
}

}  // namespace omnifleet::lens
