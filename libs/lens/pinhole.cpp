#include <fmt/format.h>

#include <array>
#include <cmath>

#include "lens/models.h"
#include "lens/monotone.h"

namespace omnifleet::lens {
namespace {

constexpr double kWidest_rad = 89.9 * kDegree;

class PinholeLens : public Lens {
 public:
  explicit PinholeLens(const CameraModel& model)
      : focal_(model.focal_px), centre_(model.principal_point_px), skew_px_(model.skew_px) {
    for (std::size_t i = 0; i < model.distortion.size(); ++i) k_[i] = model.distortion[i];
    tangential_ = k_[2] != 0.0 || k_[3] != 0.0;
    const auto slope = [this](double theta) { return radial(std::tan(theta)).second; };
    const double end_rad = firstBreak(slope, kWidest_rad, 16000).value_or(kWidest_rad);
    end_ = std::tan(end_rad);
    end_distorted_ = radial(end_).first;
    checkImage(model, end_rad);
  }

  std::optional<Eigen::Vector2d> pixelFromRay(const Eigen::Vector3d& ray) const override {
    if (!(ray.z() > 0.0)) return std::nullopt;
    const Eigen::Vector2d p = ray.head<2>() / ray.z();
    if (!(p.norm() <= end_)) return std::nullopt;
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d d = distort(p, jacobian);
    if (tangential_ && !(jacobian.determinant() > 0.0)) return std::nullopt;
    Eigen::Vector2d pixel = centre_ + focal_.cwiseProduct(d);
    pixel.x() += skew_px_ * d.y();
    return pixel;
  }

  std::optional<Eigen::Vector3d> rayFromPixel(const Eigen::Vector2d& pixel) const override {
    Eigen::Vector2d d = (pixel - centre_).cwiseQuotient(focal_);
    d.x() -= skew_px_ / focal_.x() * d.y();
    const std::optional<Eigen::Vector2d> p = undistort(d);
    if (!p) return std::nullopt;
    return Eigen::Vector3d(p->x(), p->y(), 1.0).normalized();
  }

 private:
  /// g(r) = r·(1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) and g'(r).
  std::pair<double, double> radial(double r) const {
    const double s = r * r;
    const double top = 1.0 + s * (k_[0] + s * (k_[1] + s * k_[4]));
    const double bottom = 1.0 + s * (k_[5] + s * (k_[6] + s * k_[7]));
    const double top_slope = 2.0 * r * (k_[0] + s * (2.0 * k_[1] + s * 3.0 * k_[4]));
    const double bottom_slope = 2.0 * r * (k_[5] + s * (2.0 * k_[6] + s * 3.0 * k_[7]));
    if (!(bottom > 0.0)) return {0.0, -1.0};  // a pole: not invertible beyond it
    return {r * top / bottom,
            top / bottom + r * (top_slope * bottom - top * bottom_slope) / (bottom * bottom)};
  }

  /// OpenCV's distortion of a point on the plane z = 1, with its Jacobian.
  Eigen::Vector2d distort(const Eigen::Vector2d& p, Eigen::Matrix2d& jacobian) const {
    const double x = p.x(), y = p.y(), s = x * x + y * y, r = std::sqrt(s), p1 = k_[2], p2 = k_[3];
    const auto [g, slope] = radial(r);
    const double ratio = r > 1e-12 ? g / r : 1.0;
    const Eigen::Matrix2d outer =
        r > 1e-12 ? Eigen::Matrix2d(p * p.transpose() / s) : Eigen::Matrix2d::Zero();
    jacobian = ratio * Eigen::Matrix2d::Identity() + (slope - ratio) * outer;
    jacobian(0, 0) += 2.0 * p1 * y + 6.0 * p2 * x;
    jacobian(0, 1) += 2.0 * p1 * x + 2.0 * p2 * y;
    jacobian(1, 0) += 2.0 * p1 * x + 2.0 * p2 * y;
    jacobian(1, 1) += 6.0 * p1 * y + 2.0 * p2 * x;
    return {x * ratio + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * ratio + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y};
  }

  /// Radial part by bracketed Newton (exact), then the tangential part by Newton in two dimensions.
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& d) const {
    const double distorted = d.norm();
    if (!std::isfinite(distorted) || (!tangential_ && distorted > end_distorted_)) return std::nullopt;
    const double r = solveIncreasing([this](double v) { return radial(v); },
                                     std::min(distorted, end_distorted_), 0.0, end_, distorted);
    Eigen::Vector2d p = distorted > 0.0 ? Eigen::Vector2d(d * (r / distorted)) : Eigen::Vector2d::Zero();
    if (!tangential_) return p;
    for (int i = 0; i < 50; ++i) {
      Eigen::Matrix2d jacobian;
      const Eigen::Vector2d error = distort(p, jacobian) - d;
      if (!(jacobian.determinant() > 0.0)) return std::nullopt;
      const Eigen::Vector2d step = jacobian.inverse() * error;
      p -= step;
      if (!(p.norm() <= end_ * 1.5)) return std::nullopt;
      if (step.norm() <= 1e-15 * std::max(1.0, p.norm())) break;
    }
    Eigen::Matrix2d jacobian;
    const bool solved = (distort(p, jacobian) - d).norm() <= 1e-12 * std::max(1.0, distorted);
    return solved && p.norm() <= end_ ? std::optional<Eigen::Vector2d>(p) : std::nullopt;
  }

  /// The middles of the image edges must be visible. Corners may lie beyond the invertible range.
  void checkImage(const CameraModel& model, double end_rad) const {
    const double right = model.image_width_px - 1.0, bottom = model.image_height_px - 1.0;
    const std::array<Eigen::Vector2d, 4> middles{
        {{0.0, centre_.y()}, {right, centre_.y()}, {centre_.x(), 0.0}, {centre_.x(), bottom}}};
    for (const Eigen::Vector2d& middle : middles) {
      if (rayFromPixel(middle)) continue;
      throw options::Error(
          fmt::format("distortion: the lens cannot be inverted beyond {:.2f}° from its axis and does not "
                      "reach pixel ({:g}, {:g})",
                      end_rad / kDegree, middle.x(), middle.y()));
    }
  }

  Eigen::Vector2d focal_, centre_;
  double skew_px_ = 0.0;
  std::array<double, 8> k_{};
  bool tangential_ = false;
  double end_ = 0.0, end_distorted_ = 0.0;  ///< radius in the plane z = 1, before and after distortion
};

}  // namespace

std::unique_ptr<const Lens> makePinhole(const CameraModel& model) {
  return std::make_unique<PinholeLens>(model);
}

}  // namespace omnifleet::lens
