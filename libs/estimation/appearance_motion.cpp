#include "estimation/appearance_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

// σ of α (m per unit of D), β (m/rad) and γ (m) before any step.
const Eigen::Vector3d kPriorSigmas(3.0, 0.1, 0.02);
constexpr double kLeast_m = 0.005;  // σ of a length about the fit, at least: D has noise, too
constexpr int kRounds = 3;          // of fit and variance
constexpr double kFreeShare = 0.3;  // σ of a step of free scale, as a share of its length

}  // namespace

AppearanceOptions AppearanceOptions::read(const options::Section& section) {
  AppearanceOptions o;
  section.read("use", o.use);
  section.read("with_wheels", o.with_wheels);
  section.read("least_confidence", o.least_confidence, {0.0, 1.0});
  section.read("sigma_factor", o.sigma_factor, {0.1, 100.0});
  section.read("robust_sigmas", o.robust_sigmas, {0.1, 100.0});
  section.read("memory_steps", o.memory_steps, {1.0, 1e6});
  section.read("prior_steps", o.prior_steps, {1.0, 1e6});
  section.read("free_scale", o.free_scale);
  o.quality = CompassQualityOptions::read(section.child("quality"));
  section.finish();
  return o;
}

DifferenceScale::DifferenceScale(const AppearanceOptions& options) : options_(options) {}

void DifferenceScale::add(double length_m, double difference, double turn_rad) {
  if (!(difference > 0)) return;
  const double keep = 1.0 - 1.0 / options_.memory_steps;
  const Eigen::Vector3d x(difference, std::abs(turn_rad), 1.0);
  weight_ = keep * weight_ + 1.0;
  moments_ = keep * moments_ + x * x.transpose();
  lengths_ = keep * lengths_ + length_m * x;
  squares_ = keep * squares_ + length_m * length_m;
}

std::optional<DifferenceScale::Length> DifferenceScale::lengthOf(double difference, double turn_rad) const {
  if (!isMetric()) {
    if (!options_.free_scale) return std::nullopt;
    return Length{difference, kFreeShare * difference};
  }
  const Eigen::Vector3d x(difference, std::abs(turn_rad), 1.0);
  const Eigen::Matrix3d prior = kPriorSigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  // Variance of a single length about the fit: first as if it were that of the prior's γ, then by the
  // residuals.
  double variance = kPriorSigmas.z() * kPriorSigmas.z();
  Eigen::LDLT<Eigen::Matrix3d> information;
  Eigen::Vector3d fit = Eigen::Vector3d::Zero();
  for (int round = 0; round < kRounds; ++round) {
    information.compute(moments_ / variance + prior);
    fit = information.solve(lengths_ / variance);
    const double residual = squares_ - 2.0 * fit.dot(lengths_) + fit.dot(moments_ * fit);
    variance = std::max(residual / weight_, kLeast_m * kLeast_m);
  }
  return Length{std::max(0.0, fit.dot(x)), std::sqrt(variance + x.dot(information.solve(x)))};
}

bool hasTurn(const Appearance& appearance, TimeNs since_ns, const AppearanceOptions& options) {
  return options.use && appearance.since_ns != 0 && appearance.since_ns == since_ns &&
         appearance.turn_sigma_rad > 0 && appearance.confidence >= options.least_confidence;
}

}  // namespace omnifleet::estimation
