#include "estimation/camera_error.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

namespace omnifleet::estimation {

CameraOptions CameraOptions::read(const options::Section& section) {
  CameraOptions o;
  section.read("estimate", o.estimate);
  section.read("focal_sigma", o.focal_sigma, {1e-6, 0.2});
  section.read("height_sigma", o.height_sigma, {1e-6, 0.2});
  section.read("tilt_sigma_rad", o.tilt_sigma_rad, {1e-6, 0.2});
  section.read("contour_sigma_rad", o.contour_sigma_rad, {1e-7, 0.2});
  section.finish();
  return o;
}

CameraError CameraOptions::sigma() const {
  if (!estimate) return CameraError::Constant(1e-9);
  CameraError sigma;
  sigma << focal_sigma, height_sigma, tilt_sigma_rad, tilt_sigma_rad, contour_sigma_rad;
  return sigma;
}

CameraError CameraOptions::sigmaAt(const CameraError& error) const {
  CameraError all = sigma();
  const double off = error(kHeight) / (kHeightLoss * all(kHeight));
  all(kHeight) *= std::sqrt(1.0 + off * off);
  return all;
}

namespace {

/// σ of what all outlines have in common, which does not become less with their number: about a tenth of a
/// pixel.
const Eigen::Vector4d& common() {
  static const Eigen::Vector4d sigma(0.0005, 0.001, 0.00035, 0.00035);
  return sigma;
}

}  // namespace

Eigen::Vector4d believedError(const CameraError& error, const CameraCovariance& covariance,
                              const CameraOptions& options) {
  if (!options.estimate) return Eigen::Vector4d::Zero();
  const Eigen::Vector4d sigma = options.sigmaAt(error).head<4>();
  const Eigen::Matrix4d prior = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  const Eigen::Matrix4d information = covariance.topLeftCorner<4, 4>().inverse();
  // What was seen alone, and less surely so, J → (J⁻¹ + C)⁻¹: J may be singular.
  const Eigen::Matrix4d seen = information - prior, common2 = common().cwiseAbs2().asDiagonal();
  const Eigen::Matrix4d less = (Eigen::Matrix4d::Identity() + seen * common2).inverse();
  const Eigen::Matrix4d surely = less * seen;
  const Eigen::LLT<Eigen::Matrix4d> after(prior + 0.5 * (surely + surely.transpose()));
  if (after.info() != Eigen::Success) return Eigen::Vector4d::Zero();
  const Eigen::Vector4d mean = after.solve(less * (information * error.head<4>()));
  // ln of the densities of zero: with the prior, with what was seen.
  const double before_ln = -sigma.array().log().sum();
  const double after_ln =
      after.matrixLLT().diagonal().array().log().sum() - 0.5 * (after.matrixU() * mean).squaredNorm();
  return error.head<4>() / (1.0 + std::exp(after_ln - before_ln));
}

namespace {

struct Quantity {
  const char* name;
  double scale;
  const char* unit;
};
constexpr double kDegrees = 180.0 / M_PI;
constexpr Quantity kQuantities[] = {{"focal length", 100.0, " %"},
                                    {"height", 100.0, " %"},
                                    {"roll", kDegrees, " degrees"},
                                    {"pitch", kDegrees, " degrees"}};

}  // namespace

CameraFinding::CameraFinding(const CameraError& error, const CameraCovariance& covariance,
                             const CameraOptions& options) {
  const CameraCovariance information = covariance.inverse();
  const CameraCovariance prior = options.sigmaAt(error).cwiseAbs2().cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<CameraCovariance> seen(information - prior);
  if (!options.estimate || !(seen.eigenvalues().minCoeff() > 0)) return;
  const CameraCovariance by_sight =
      seen.eigenvectors() * seen.eigenvalues().cwiseInverse().asDiagonal() * seen.eigenvectors().transpose();
  estimate_ = (by_sight * (information * error)).head<4>();
  sigma_ = (by_sight.diagonal().head<4>() + common().cwiseAbs2()).cwiseSqrt();
}

CameraFinding::Quantities CameraFinding::beyond(double sigmas) const {
  Quantities which;
  for (int i = 0; i < 4; ++i)
    which[static_cast<std::size_t>(i)] = std::abs(estimate_(i)) > sigmas * sigma_(i);
  return which;
}

std::string CameraFinding::describe(const Quantities& which) const {
  std::string text;
  for (std::size_t i = 0; i < which.size(); ++i) {
    if (!which[i]) continue;
    const auto at = static_cast<Eigen::Index>(i);
    const Quantity& q = kQuantities[i];
    char part[96];
    std::snprintf(part, sizeof part, "%s%s %+.2f ± %.2f%s", text.empty() ? "" : ", ", q.name,
                  q.scale * estimate_(at), q.scale * sigma_(at), q.unit);
    text += part;
  }
  return text;
}

std::string CameraFinding::name(const Quantities& which) {
  std::string text;
  for (std::size_t i = 0; i < which.size(); ++i) {
    if (which[i]) text += (text.empty() ? "" : ", ") + std::string(kQuantities[i].name);
  }
  return text;
}

double displacement(const Eigen::Vector4d& error, const lens::Spread& lens) {
  constexpr double kDistance = 3.0;
  const Eigen::Matrix<double, 2, 4> along = cameraField({kDistance, 0.0}, 1.0, lens);
  return std::abs(along(0, 0) * error(0)) + std::abs(along(0, 1) * error(1)) +
         (1.0 + kDistance * kDistance) * error.tail<2>().norm();
}

}  // namespace omnifleet::estimation
