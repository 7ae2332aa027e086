#include "ground/floor_light.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kLevel = 0, kAmbient = 1, kX = 2, kY = 3, kHeight = 4, kRim = 5;
constexpr int kSamples = 300;
constexpr double kSigma = 0.03;  // deviation of a block's brightness from the model, as a share
constexpr double kLargeProduct = 1e200;
constexpr int kRounds = 12;
constexpr double kDone = 1e-3;  // smaller steps, in standard deviations, end the iteration
// Prior for indoor light: ambient share, distance of the lamp, and its height s (logarithm).
constexpr double kPriorMean[] = {0.0, 0.3, 0.0, 0.0, 0.83, -0.1},
                 kPriorSigma[] = {10.0, 0.3, 2.0, 2.0, 0.5, 0.2};
constexpr double kLowerBound[] = {-10.0, 0.01, -6.0, -6.0, -0.2, -0.7},
                 kUpperBound[] = {10.0, 1.0, 6.0, 6.0, 2.0, 0.1};
constexpr float kBeyond_m = 50.0f;  // marks places without floor

/// Terms of (1 + q)^(-3/2).
struct Lambert {
  double u, fall;  ///< 1 / (1 + q); u^(3/2)
};
Lambert lambert(double q) {
  const double u = 1.0 / (1.0 + q);
  return {u, u * std::sqrt(u)};
}

/// Logarithm of the floor's illumination.
class LogLight {
 public:
  explicit LogLight(const Eigen::Matrix<double, 6, 1>& p) : p_(p), per_s2_(std::exp(-2.0 * p[kHeight])) {}
  double at(double x_m, double y_m, double rim2) const {
    const double dx = x_m - p_[kX], dy = y_m - p_[kY];
    const double fall = lambert((dx * dx + dy * dy) * per_s2_).fall;
    return std::log(p_[kAmbient] + (1.0 - p_[kAmbient]) * fall) + p_[kRim] * rim2;
  }
  double atFoot() const { return at(0.0, 0.0, 0.0); }

 private:
  const Eigen::Matrix<double, 6, 1>& p_;
  double per_s2_;
};

OMNIFLEET_WIDE void evaluateRow(const float* x, const float* y, const float* rim2, int n, const float* p,
                                float* light) {
  const float ambient = p[kAmbient], lamp = 1.0f - ambient, per_s2 = p[kHeight], scale = p[kLevel];
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float dx = x[i] - p[kX], dy = y[i] - p[kY], u = 1.0f / (1.0f + (dx * dx + dy * dy) * per_s2);
    // exp(t) for −0.7 ≤ t ≤ 0.1, accurate to 0.001.
    const float t = p[kRim] * rim2[i], half = 1.0f + 0.5f * t + 0.125f * t * t + t * t * t / 48.0f;
    light[i] = scale * (ambient + lamp * u * std::sqrt(u)) * half * half;
  }
}

/// Parameters of the lamp: ambient share, c, 1 / s².
struct Lamp {
  float ambient, x_m, y_m, per_s2;
};

OMNIFLEET_WIDE void shareRow(const float* x, const float* y, int n, const Lamp& lamp, float* share) {
  const auto [ambient, x_m, y_m, per_s2] = lamp;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float dx = x[i] - x_m, dy = y[i] - y_m, u = 1.0f / (1.0f + (dx * dx + dy * dy) * per_s2);
    share[i] = ambient / (ambient + (1.0f - ambient) * u * std::sqrt(u));
  }
}

/// Floor positions of a row of cells; the rows above and below are `step` away.
struct FloorOfRow {
  const float *x_m, *y_m;
  std::ptrdiff_t step;
};

/// Moves on the floor by J · (step in the image). J is the finite difference between the cells on both sides.
void towardsRow(const FloorOfRow& floor, const cv::Point2f& lamp_m, int n, float* out) {
  for (int i = 1; i + 1 < n; ++i) {
    const float* here = floor.x_m + i;
    const float farthest =
        std::max({here[0], here[-1], here[1], here[-floor.step], here[floor.step]});  // kBeyond_m: no floor
    const float *x = floor.x_m + i, *y = floor.y_m + i;
    const float a = x[1] - x[-1], b = x[floor.step] - x[-floor.step], c = y[1] - y[-1],
                d = y[floor.step] - y[-floor.step], dx = lamp_m.x - x[0], dy = lamp_m.y - y[0];
    const float determinant = a * d - b * c;
    float to_x = d * dx - b * dy, to_y = a * dy - c * dx;
    if (determinant < 0.0f) to_x = -to_x, to_y = -to_y;
    const float length = std::sqrt(to_x * to_x + to_y * to_y);
    const bool is_floor = farthest < kBeyond_m && determinant != 0.0f && length > 0.0f;
    out[2 * i] = is_floor ? to_x / length : 0.0f;
    out[2 * i + 1] = is_floor ? to_y / length : 0.0f;
  }
}

}  // namespace

FloorLight::FloorLight(const lens::Camera& camera, cv::Size cells, int cell_px, int block)
    : cells_(placesOf(camera, cells, cell_px)),
      blocks_(placesOf(camera, {cells.width / block, cells.height / block}, cell_px * block)),
      of_cells_(cells),
      of_blocks_(blocks_.x_m.size()),
      ambient_share_(cells),
      towards_lamp_(cells, cv::Vec2f(0, 0)) {
  scaleRim(cells_, blocks_);
  samples_.reserve(2 * kSamples);
}

FloorLight::Places FloorLight::placesOf(const lens::Camera& camera, cv::Size count, int pixels) {
  Places places{cv::Mat1f(count, kBeyond_m), cv::Mat1f(count, 0.0f), cv::Mat1f(count, 0.0f)};
  for (int y = 0; y < count.height; ++y) {
    for (int x = 0; x < count.width; ++x) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(x + 0.5, y + 0.5) * pixels - Eigen::Vector2d(0.5, 0.5);
      const auto point = camera.floorFromPixel(pixel);
      if (!point) continue;
      const Eigen::Vector2d off = *point - camera.foot();
      if (off.norm() > kBeyond_m) continue;
      places.x_m(y, x) = static_cast<float>(off.x());
      places.y_m(y, x) = static_cast<float>(off.y());
      places.rim2(y, x) = static_cast<float>((pixel - camera.model().principal_point_px).squaredNorm());
    }
  }
  return places;
}

/// Scales squared pixels to shares of the farthest cell's value, in both.
void FloorLight::scaleRim(Places& cells, Places& blocks) {
  double farthest = 0.0;
  cv::minMaxLoc(cells.rim2, nullptr, &farthest);
  if (farthest <= 0.0) return;
  for (Places* places : {&cells, &blocks}) places->rim2 /= farthest;
}

FloorLight::Parameters FloorLight::initialGuess() {
  return Eigen::Map<const Parameters>(kPriorMean);
}

void FloorLight::reset() {
  p_ = kept_ = initialGuess();
}

FloorLight::Parameters FloorLight::bounded(const Parameters& p) {
  return p.cwiseMax(Eigen::Map<const Parameters>(kLowerBound))
      .cwiseMin(Eigen::Map<const Parameters>(kUpperBound));
}

void FloorLight::gather(const RegionGrowing& growing) {
  samples_.clear();
  const std::size_t grown = growing.grown().size(), step = std::max<std::size_t>(1, grown / kSamples);
  double sum = 0.0;
  for (std::size_t k = 0; k < grown; k += step) {
    const cv::Point at = growing.blockAt(growing.grown()[k]);
    const float brightness = growing.brightnessAt(growing.grown()[k]);
    if (brightness <= 1.0f) continue;
    samples_.push_back({blocks_.x_m(at), blocks_.y_m(at), blocks_.rim2(at), std::log(brightness)});
    sum += samples_.back().level;
  }
  // The level has no meaning. A value near 0 keeps it within its bounds.
  for (Sample& sample : samples_)
    sample.level -= static_cast<float>(sum / static_cast<double>(samples_.size()));
}

void FloorLight::linearise(const Parameters& p, Hessian& hessian, Parameters& gradient) const {
  hessian.setZero();
  gradient.setZero();
  const double per_s2 = std::exp(-2.0 * p[kHeight]), lamp = 1.0 - p[kAmbient];
  for (const Sample& sample : samples_) {
    const double dx = sample.x_m - p[kX], dy = sample.y_m - p[kY], q = (dx * dx + dy * dy) * per_s2;
    const auto [u, fall] = lambert(q);
    const double light = p[kAmbient] + lamp * fall, by_q = -1.5 * lamp * u * fall / light;
    const double residual = (sample.level - p[kLevel] - std::log(light) - p[kRim] * sample.rim2) / kSigma;
    Parameters slope;
    slope << 1.0, (1.0 - fall) / light, -2.0 * by_q * dx * per_s2, -2.0 * by_q * dy * per_s2, -2.0 * by_q * q,
        sample.rim2;
    slope /= kSigma;
    const double weight = 1.0 / (1.0 + residual * residual);
    gradient += weight * residual * slope;
    hessian.noalias() += slope * (weight * slope).transpose();
  }
  for (int i = 0; i < kParameters; ++i) {
    gradient[i] -= (p[i] - kPriorMean[i]) / (kPriorSigma[i] * kPriorSigma[i]);
    hessian(i, i) += 1.0 / (kPriorSigma[i] * kPriorSigma[i]);
  }
}

/// Cauchy loss of the residuals in standard deviations, plus the prior.
double FloorLight::costOf(const Parameters& p) const {
  const auto prior = Eigen::Map<const Parameters>(kPriorMean),
             sigma = Eigen::Map<const Parameters>(kPriorSigma);
  double cost = (p - prior).cwiseQuotient(sigma).squaredNorm();
  const LogLight light(p);
  double product = 1.0;  // sums logarithms as the logarithm of a product, which is much cheaper
  for (const Sample& sample : samples_) {
    const double residual =
        (sample.level - p[kLevel] - light.at(sample.x_m, sample.y_m, sample.rim2)) / kSigma;
    product *= 1.0 + residual * residual;
    if (product < kLargeProduct) continue;
    cost += std::log(product);
    product = 1.0;
  }
  return cost + std::log(product);
}

/// Levenberg–Marquardt. Ceres is not used because it allocates in each solve.
bool FloorLight::fit(const RegionGrowing& growing) {
  gather(growing);
  change_ = 0.0;
  darkest_ = 1.0;
  if (samples_.size() < static_cast<std::size_t>(kSamples / 3)) return false;
  const Parameters before = p_;
  double damping = 1e-3;
  Hessian hessian;
  Parameters gradient;
  double cost = costOf(p_);
  linearise(p_, hessian, gradient);
  for (int round = 0; round < kRounds; ++round) {
    Hessian damped = hessian.selfadjointView<Eigen::Lower>();
    const Parameters scale = damped.diagonal();
    damped.diagonal() += damping * scale;
    const Parameters next = bounded(p_ + damped.llt().solve(gradient)), step = next - p_;
    const double next_cost = costOf(next);
    if (!(next_cost < cost)) {
      damping *= 10.0;
      if (damping > 1e3) break;
      continue;
    }
    p_ = next;
    damping = std::max(1e-6, 0.1 * damping);
    cost = next_cost;
    linearise(p_, hessian, gradient);
    if (step.cwiseAbs2().dot(scale) < kDone * kDone) break;
  }
  const LogLight light(p_), light_before(before);
  const double at_foot = light.atFoot(), at_foot_before = light_before.atFoot();
  double least = 0.0;
  for (const Sample& sample : samples_) {
    const double since_foot = light.at(sample.x_m, sample.y_m, sample.rim2) - at_foot,
                 since_foot_before = light_before.at(sample.x_m, sample.y_m, sample.rim2) - at_foot_before;
    change_ = std::max(change_, std::abs(since_foot - since_foot_before));
    least = std::min(least, since_foot);
  }
  darkest_ = std::exp(least);
  return true;
}

const cv::Mat1f& FloorLight::ambientShareOfCells() {
  const auto ambient = static_cast<float>(of_last_blocks_[kAmbient]),
             x_m = static_cast<float>(of_last_blocks_[kX]), y_m = static_cast<float>(of_last_blocks_[kY]),
             per_s2 = static_cast<float>(std::exp(-2.0 * of_last_blocks_[kHeight]));
  for (int y = 0; y < ambient_share_.rows; ++y)
    shareRow(cells_.x_m.ptr<float>(y), cells_.y_m.ptr<float>(y), ambient_share_.cols,
             {ambient, x_m, y_m, per_s2}, ambient_share_.ptr<float>(y));
  return ambient_share_;
}

const cv::Mat2f& FloorLight::towardsLampOfCells() {
  const auto lamp_x_m = static_cast<float>(of_last_blocks_[kX]),
             lamp_y_m = static_cast<float>(of_last_blocks_[kY]);
  const cv::Mat1f &x_m = cells_.x_m, &y_m = cells_.y_m;
  for (int y = 1; y + 1 < towards_lamp_.rows; ++y)
    towardsRow({x_m.ptr<float>(y), y_m.ptr<float>(y), static_cast<std::ptrdiff_t>(x_m.step1())},
               {lamp_x_m, lamp_y_m}, towards_lamp_.cols, towards_lamp_.ptr<float>(y));
  return towards_lamp_;
}

void FloorLight::evaluate(const Parameters& fitted, const Places& places, cv::Mat1f& light) {
  float p[kParameters];
  for (int i = 0; i < kParameters; ++i) p[i] = static_cast<float>(fitted[i]);
  p[kHeight] = static_cast<float>(std::exp(-2.0 * fitted[kHeight]));
  p[kLevel] = static_cast<float>(std::exp(-LogLight(fitted).atFoot()));
  for (int y = 0; y < light.rows; ++y)
    evaluateRow(places.x_m.ptr<float>(y), places.y_m.ptr<float>(y), places.rim2.ptr<float>(y), light.cols, p,
                light.ptr<float>(y));
}

const cv::Mat1f& FloorLight::ofBlocks() {
  of_last_blocks_ = p_;
  evaluate(p_, blocks_, of_blocks_);
  return of_blocks_;
}

const cv::Mat1f& FloorLight::ofCells() {
  evaluate(of_last_blocks_, cells_, of_cells_);
  return of_cells_;
}

}  // namespace omnifleet::ground
