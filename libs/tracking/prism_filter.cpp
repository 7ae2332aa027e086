#include "tracking/prism_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr double kLeastRatio = 0.03, kMostRatio = 1.0;  // u = 1/s; 0.03: nearly as tall as the camera
constexpr double kUnknownPosition_m = 2.0, kUnknownVelocity_mps = 0.5;
constexpr double kStillVelocityDecay_s = 0.5;   // s, velocity decay of a stationary object
constexpr double kUnseenVelocityDecay_s = 2.0;  // s, an object that is not visible may have stopped

/// Value that replaces b in the derivative by u; its noise must not enter. If only the far side is visible,
/// distance and height are correlated (the object may be larger and farther). Noise in the regressor would
/// then count as information on both, in every frame. Therefore the predicted support replaces b once the
/// object is known well enough.
double regressor(double measured, double predicted, double ratio) {
  constexpr double kSettled_m = 0.10;
  return std::abs(predicted - measured) * ratio < kSettled_m ? -predicted : -measured;
}

/// Row of the measurement equation: h_P(n) as a linear function of the state, with u's entry zero.
PrismFilter::State footprintRow(double cos1, double sin1) {
  const double cos2 = cos1 * cos1 - sin1 * sin1, sin2 = 2.0 * cos1 * sin1;
  const double cos3 = cos2 * cos1 - sin2 * sin1, sin3 = sin2 * cos1 + cos2 * sin1;
  const double cos4 = cos2 * cos2 - sin2 * sin2, sin4 = 2.0 * cos2 * sin2;
  PrismFilter::State row;
  row << cos1, sin1, 0.0, 0.0, 1.0, 0.0, cos2, sin2, cos3, sin3, cos4, sin4;
  return row;
}

}  // namespace

PrismFilterOptions PrismFilterOptions::read(const options::Section& section) {
  PrismFilterOptions o;
  section.read("radius_m", o.radius_m, {0.01, 5.0});
  section.read("radius_sigma_m", o.radius_sigma_m, {0.001, 5.0});
  section.read("roundness_sigma_m", o.roundness_sigma_m, {0.001, 1.0});
  section.read("height_ratio", o.height_ratio, {0.01, 0.97});
  section.read("height_ratio_sigma", o.height_ratio_sigma, {0.01, 1.0});
  section.read("model_sigma_m", o.model_sigma_m, {0.0001, 0.1});
  section.read("correlation", o.correlation, {1.0, 96.0});
  section.read("acceleration_mps2", o.acceleration_mps2, {0.01, 20.0});
  section.read("still_acceleration_mps2", o.still_acceleration_mps2, {0.0, 20.0});
  section.read("outlier", o.outlier, {1.0, 100.0});
  section.finish();
  return o;
}

PrismFilter::PrismFilter(const PrismFilterOptions& options, const Eigen::Vector2d& guess_m,
                         double camera_height_m)
    : options_(options), camera_height_m_(camera_height_m) {
  state_.setZero();
  covariance_.setZero();
  state_.head<2>() = guess_m;
  covariance_.diagonal().head<2>().setConstant(kUnknownPosition_m * kUnknownPosition_m);
  covariance_.diagonal().segment<2>(2).setConstant(kUnknownVelocity_mps * kUnknownVelocity_mps);
  forgetShape();
}

void PrismFilter::forgetShape() {
  covariance_.bottomRows<8>().setZero();
  covariance_.rightCols<8>().setZero();
  state_.tail<8>().setZero();
  state_[4] = options_.radius_m;
  covariance_(4, 4) = options_.radius_sigma_m * options_.radius_sigma_m;
  const bool flat = camera_height_m_ <= 0.0;  // a laser: no far side over the top
  state_[5] = flat ? 1.0 : 1.0 - options_.height_ratio;
  covariance_(5, 5) = flat ? 1e-6 : options_.height_ratio_sigma * options_.height_ratio_sigma;
  covariance_.diagonal().tail<6>().setConstant(options_.roundness_sigma_m * options_.roundness_sigma_m);
}

void PrismFilter::assumeBody(double mean_radius_m, double height_m, bool round) {
  constexpr double kBodySigma_m = 0.003, kRatioSigma = 0.01, kLoosened_m = 0.05;
  forgetShape();
  covariance_.diagonal().head<2>().array() += kLoosened_m * kLoosened_m;
  state_[4] = mean_radius_m;
  covariance_(4, 4) = kBodySigma_m * kBodySigma_m;
  if (round) covariance_.diagonal().tail<6>().setConstant(kBodySigma_m * kBodySigma_m);
  if (camera_height_m_ > 0.0) {
    state_[5] = std::clamp(1.0 - height_m / camera_height_m_, kLeastRatio, kMostRatio);
    covariance_(5, 5) = kRatioSigma * kRatioSigma;
  }
}

void PrismFilter::placeAt(const Eigen::Vector2d& position_m, const Eigen::Vector2d& velocity_mps,
                          const Eigen::Matrix2d& covariance) {
  covariance_.topRows<4>().setZero();
  covariance_.leftCols<4>().setZero();
  state_.head<2>() = position_m;
  state_.segment<2>(2) = velocity_mps;
  covariance_.topLeftCorner<2, 2>() = covariance;
  covariance_.diagonal().segment<2>(2).setConstant(kUnknownVelocity_mps * kUnknownVelocity_mps);
}

void PrismFilter::predict(double dt_s, bool moving, bool visible, const Eigen::Matrix2d& own_noise) {
  const double tau = !moving ? kStillVelocityDecay_s : kUnseenVelocityDecay_s;
  const double keep = moving && visible ? 1.0 : std::exp(-dt_s / tau);
  const double acceleration = moving ? options_.acceleration_mps2 : options_.still_acceleration_mps2;
  Covariance f = Covariance::Identity();
  f.block<2, 2>(0, 2) = dt_s * Eigen::Matrix2d::Identity();
  f.block<2, 2>(2, 2) = keep * Eigen::Matrix2d::Identity();
  state_ = (f * state_).eval();
  covariance_ = (f * covariance_ * f.transpose()).eval();
  const double q = acceleration * acceleration;
  for (int i = 0; i < 2; ++i) {
    covariance_(i, i) += 0.25 * q * dt_s * dt_s * dt_s * dt_s;
    covariance_(i, i + 2) += 0.5 * q * dt_s * dt_s * dt_s;
    covariance_(i + 2, i) += 0.5 * q * dt_s * dt_s * dt_s;
    covariance_(i + 2, i + 2) += q * dt_s * dt_s;
  }
  covariance_.topLeftCorner<2, 2>() += own_noise;
}

void PrismFilter::predictAcrossGap(double sigma_m) {
  state_.segment<2>(2).setZero();
  covariance_.block<2, 10>(2, 2).setZero();
  covariance_.block<10, 2>(2, 2).setZero();
  covariance_.block<2, 2>(0, 2).setZero();
  covariance_.block<2, 2>(2, 0).setZero();
  covariance_.diagonal().head<2>().array() += sigma_m * sigma_m;
  covariance_.diagonal().segment<2>(2).setConstant(kUnknownVelocity_mps * kUnknownVelocity_mps);
}

double PrismFilter::update(const View& view) {
  Covariance information = Covariance::Zero();
  State right = State::Zero();
  int used = 0, outliers = 0;
  const double ratio = std::clamp(state_[5], kLeastRatio, kMostRatio);
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    const double phi = view.angle(k), b = view.supports.b_m[k];
    State row = footprintRow(std::cos(phi), std::sin(phi));
    const double foot = row[0] * view.foot_m.x() + row[1] * view.foot_m.y();
    const bool far = b >= 0.0;
    if (far) row[5] = -b;
    const double measured = far ? foot : b + foot;
    const double sigma = (far ? ratio : 1.0) * view.supports.sigma_m[k];
    double variance =
        (sigma * sigma + options_.model_sigma_m * options_.model_sigma_m) * options_.correlation;
    const double residual = measured - row.dot(state_);
    if (far) row[5] = regressor(b, (row.dot(state_) + ratio * b - foot) / ratio, ratio);
    const double expected = variance / options_.correlation + row.dot(covariance_ * row);
    const double excess = residual * residual / (expected * options_.outlier * options_.outlier);
    if (excess > 1.0) variance *= excess;
    outliers += excess > 1.0 ? 1 : 0;
    ++used;
    information.selfadjointView<Eigen::Lower>().rankUpdate(row, 1.0 / variance);
    right += residual / variance * row;
  }
  information.triangularView<Eigen::StrictlyUpper>() = information.transpose();
  const Covariance prior_information = covariance_.llt().solve(Covariance::Identity());
  const Eigen::LLT<Covariance> posterior(prior_information + information);
  covariance_ = posterior.solve(Covariance::Identity());
  state_ += covariance_ * right;
  state_[5] = std::clamp(state_[5], kLeastRatio, kMostRatio);
  state_[4] = std::max(0.01, state_[4]);
  return used > 0 ? static_cast<double>(outliers) / used : 0.0;
}

void PrismFilter::updateHeight(double height_m, double sigma_m) {
  if (!(sigma_m > 0.0) || !std::isfinite(height_m) || camera_height_m_ <= 0.0) return;
  const double measured = 1.0 - height_m / camera_height_m_, sigma = sigma_m / camera_height_m_;
  const State column = covariance_.col(5);
  const double innovation = covariance_(5, 5) + sigma * sigma;
  if (std::abs(measured - state_[5]) > options_.outlier * std::sqrt(innovation)) return;
  state_ += column * ((measured - state_[5]) / innovation);
  covariance_ -= column * column.transpose() / innovation;
  state_[5] = std::clamp(state_[5], kLeastRatio, kMostRatio);
}

void PrismFilter::updatePosition(const Eigen::Vector2d& position_m, const Eigen::Matrix2d& covariance) {
  const Eigen::Matrix<double, kStates, 2> columns = covariance_.leftCols<2>();
  const Eigen::Matrix2d innovation = positionCovariance() + covariance;
  const Eigen::Matrix<double, kStates, 2> gain = columns * innovation.inverse();
  state_ += gain * (position_m - position());
  covariance_ -= gain * columns.transpose();
  state_[5] = std::clamp(state_[5], kLeastRatio, kMostRatio);
}

double PrismFilter::reach(double angle_rad) const {
  State row = footprintRow(std::cos(angle_rad), std::sin(angle_rad));
  row.head<4>().setZero();
  return row.dot(state_);
}

double PrismFilter::height() const {
  return camera_height_m_ > 0.0 ? (1.0 - state_[5]) * camera_height_m_ : 0.0;
}

double PrismFilter::heightSigma() const {
  return camera_height_m_ > 0.0 ? std::sqrt(covariance_(5, 5)) * camera_height_m_ : 0.0;
}

double PrismFilter::predictedSupport(const Eigen::Vector2d& foot_m, double angle_rad) const {
  const State row = footprintRow(std::cos(angle_rad), std::sin(angle_rad));
  const double g = row.dot(state_) - row.head<2>().dot(foot_m);
  return g < 0.0 ? g : g / std::clamp(state_[5], kLeastRatio, kMostRatio);
}

Polygon PrismFilter::footprint(int vertices) const {
  // Curve with support function h: x(φ) = h(φ) n(φ) + h'(φ) n⊥(φ).
  Polygon polygon;
  for (int i = 0; i < vertices; ++i) {
    const double phi = 2.0 * M_PI * i / vertices;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), across(-n.y(), n.x());
    double h = state_[4], slope = 0.0;
    for (int m = 2; m <= 4; ++m) {
      const double alpha = state_[2 + 2 * m], beta = state_[3 + 2 * m];
      h += alpha * std::cos(m * phi) + beta * std::sin(m * phi);
      slope += m * (beta * std::cos(m * phi) - alpha * std::sin(m * phi));
    }
    polygon.push_back(position() + h * n + slope * across);
  }
  return polygon;
}

}  // namespace omnifleet::tracking
