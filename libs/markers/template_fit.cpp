#include "markers/template_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::markers {
namespace {

constexpr int kCoarseIterations = 4, kFineIterations = 7;
constexpr double kSettled_px = 0.02;         // the next step is far below it: the fit converges quadratically
constexpr double kFirstChromaBlur_px = 1.1;  // of an unknown camera, for the choice of pixels
constexpr double kBlur_px = 0.7, kBlurSpread = 0.8;         // prior of the blur and σ of its logarithm
constexpr double kLeastBlur_px = 0.28, kMostBlur_px = 3.0;  // a pixel is 1 px wide: σ of 1/√12 = 0.29 px
constexpr double kLeastSigma = 1.0;  // grey levels: quantisation, gradients of the light
constexpr double kTrustedDeviation2 =
    9.0;                          // squared normalised residual at which a pixel has half its weight (Cauchy)
constexpr double kMisfit = 0.35;  // residual ÷ contrast of a pixel that shows no part of the marker
constexpr double kLeastContrast = 12.0;  // grey levels between the marker and its surroundings
constexpr double kOuterShare = 0.03;     // share of surroundings that makes a pixel one of the outline
// Residuals of neighbouring pixels are correlated (blur that is not Gaussian, blocks of JPEG), so there are
// fewer independent residuals than pixels. Measured: NEES of simulated images without a lens error.
constexpr double kCorrelation = 2.2;

constexpr Eigen::Index kLanes = 16;

/// Products of all pairs of columns, each summed in kLanes parts so that every processor gives the same bits.
/// The columns are padded with zeros to a multiple of kLanes.
OMNIFLEET_WIDE void multiplyColumns(const float* columns, Eigen::Index stride, Eigen::Index width,
                                    Eigen::Index count, double* products) {
  for (Eigen::Index i = 0; i < width; ++i) {
    for (Eigen::Index j = i; j < width; ++j) {
      const float *a = columns + i * stride, *b = columns + j * stride;
      float sum[kLanes] = {};
      for (Eigen::Index k = 0; k < count; k += kLanes) {
#pragma GCC ivdep
        for (Eigen::Index lane = 0; lane < kLanes; ++lane) sum[lane] += a[k + lane] * b[k + lane];
      }
      double total = 0.0;
      for (const float part : sum) total += static_cast<double>(part);
      products[i * width + j] = products[j * width + i] = total;
    }
  }
}

/// The part of a region in the derivatives of the predicted image.
struct Gradient {
  const float *du, *dv, *d_log_sigma;
};
OMNIFLEET_WIDE void addGradient(float own, const float* surround, const float* weight, Gradient of,
                                Eigen::Index count, float* gx, float* gy, float* gb) {
#pragma GCC ivdep
  for (Eigen::Index k = 0; k < count; ++k) {
    const float contrast = (own - surround[k]) * weight[k];
    gx[k] += of.du[k] * contrast;
    gy[k] += of.dv[k] * contrast;
    gb[k] += of.d_log_sigma[k] * contrast;
  }
}

/// Derivatives by turn and scale from those by the place. A right perturbation (dx, dy, dθ) of the pose moves
/// the pixel by the opposite amount in base_link.
OMNIFLEET_WIDE void completeGradient(const float* u, const float* v, float middle_u, float middle_v,
                                     Eigen::Index count, float* gx, float* gy, float* turn, float* scale) {
#pragma GCC ivdep
  for (Eigen::Index k = 0; k < count; ++k) {
    turn[k] = gx[k] * v[k] - gy[k] * u[k];
    scale[k] = -(gx[k] * (u[k] - middle_u) + gy[k] * (v[k] - middle_v));
    gx[k] = -gx[k];
    gy[k] = -gy[k];
  }
}

}  // namespace

TemplateFit::TemplateFit(const lens::Camera& camera, double height_m, const Layout& layout,
                         const ColourTable& table, const FitOptions& options)
    : options_(options),
      layout_(layout),
      pixels_(camera, height_m, layout, table),
      model_(layout.rectangles()),
      expected_blur_px_(kBlur_px, kFirstChromaBlur_px) {}

std::optional<Fit> TemplateFit::fit(const cv::Mat& bgr, const Pattern& pattern, const Pose2& start,
                                    double start_blur_px) {
  State state;
  Pose2 from = start;
  for (double blur_px = start_blur_px; blur_px > 1.5 * kBlur_px; blur_px *= 0.5) {
    if (!collect(bgr, pattern, from, blur_px, state)) return std::nullopt;
    state.log_blur.setConstant(std::log(blur_px));
    if (!iterate(state, false, kCoarseIterations)) return std::nullopt;
    from = from * state.start_from_base;
  }
  if (!collect(bgr, pattern, from, expected_blur_px_.maxCoeff(), state)) return std::nullopt;
  state.log_blur = expected_blur_px_.array().log();
  if (!iterate(state, true, kFineIterations)) return std::nullopt;
  return judge(from, state);
}

std::optional<Fit> TemplateFit::refit(const cv::Mat& bgr, const Pattern& pattern, const Pose2& start,
                                      const Eigen::Vector2d& blur_px, double scale, const Tone& tone) {
  if (!pixels_.collect(bgr, pattern, start, blur_px.maxCoeff(), &tone)) return std::nullopt;
  State state;
  state.colours = pixels_.regionColours();
  state.log_blur = blur_px.array().log();
  state.log_scale = std::log(scale);
  if (!iterate(state, true, kFineIterations)) return std::nullopt;
  return judge(start, state);
}

/// Collects the pixels at a better pose, because the surroundings depend on it.
bool TemplateFit::collect(const cv::Mat& bgr, const Pattern& pattern, const Pose2& at, double blur_px,
                          State& state) {
  if (!pixels_.collect(bgr, pattern, at, blur_px)) return false;
  state.start_from_base = Pose2();
  state.colours = pixels_.regionColours();
  return true;
}

/// Steps until the pose has settled. False if it does not stay within the collected pixels.
bool TemplateFit::iterate(State& state, bool free_blur, int iterations) {
  count_ = pixels_.count();
  trust_.setConstant(std::max(trust_.size(), count_), 1.0F);
  for (int i = 0; i < iterations; ++i) {
    predict(state, !free_blur);
    weigh();
    h_.setZero();
    g_.setZero();
    for (int channel = 0; channel < 3; ++channel) eliminate(state, channel);
    double size_px = 0.0;
    if (!step(state, free_blur, size_px)) return false;
    if (i > 0 && size_px < kSettled_px) break;
  }
  const double reach_px = layout_.bounds().half_m.norm() / pixels_.metresPerPx();
  return state.start_from_base.translation().norm() <
             0.5 * reach_px * pixels_.metresPerPx() + pixels_.metresPerPx() &&
         std::abs(state.start_from_base.theta_rad) < 0.6;
}

/// Positions of the pixels in base_link at the current pose and scale.
void TemplateFit::place(const State& state) {
  if (u_.size() < count_) u_.resize(pixels_.u().size()), v_.resize(pixels_.u().size());
  const Pose2 back = state.start_from_base.inverse();
  const float c = static_cast<float>(std::cos(back.theta_rad)),
              s = static_cast<float>(std::sin(back.theta_rad));
  const float shrink = static_cast<float>(std::exp(-state.log_scale));
  const Eigen::Vector2f middle = layout_.bounds().centre_m.cast<float>();
  const float x = static_cast<float>(back.x_m) - middle.x(), y = static_cast<float>(back.y_m) - middle.y();
  const auto u = pixels_.u().head(count_), v = pixels_.v().head(count_);
  u_.head(count_) = (c * u - s * v + x) * shrink + middle.x();
  v_.head(count_) = (s * u + c * v + y) * shrink + middle.y();
}

/// Coverage at the current state and the residuals.
void TemplateFit::predict(const State& state, bool one_blur) {
  place(state);
  one_blur_ = one_blur;
  const Eigen::Matrix2d base_per_px =
      state.start_from_base.rotation().transpose() * pixels_.scale() * std::exp(-state.log_scale);
  const Eigen::Vector2d per_px(base_per_px.row(0).norm(), base_per_px.row(1).norm());
  model_.evaluate(u_, v_, count_, per_px * std::exp(state.log_blur[0]), luma_);
  if (!one_blur) model_.evaluate(u_, v_, count_, per_px * std::exp(state.log_blur[1]), chroma_);
  if (residual_.rows() < count_) residual_.resize(pixels_.u().size(), 3);
  for (int c = 0; c < 3; ++c) {
    const Coverage& coverage = coverageOf(c);
    auto residual = residual_.col(c).head(count_);
    const auto surround = pixels_.surround().col(c).head(count_);
    residual = pixels_.colour().col(c).head(count_) - surround;
    for (Eigen::Index r = 0; r < model_.regions(); ++r) {
      const float own = static_cast<float>(state.colours[static_cast<std::size_t>(r)][c]);
      residual -= coverage.value.col(r).head(count_) * (own - surround);
    }
  }
}

/// Estimates σ of luma and chroma residuals, inner and outer, and the trust in each pixel.
void TemplateFit::weigh() {
  if (outer_.size() < count_) outer_.resize(pixels_.u().size());
  outer_.head(count_) =
      (luma_.value.topRows(count_).rowwise().sum() < 1.0F - static_cast<float>(kOuterShare)).cast<float>();
  const auto trust = trust_.head(count_);
  const Eigen::ArrayXf outer = outer_.head(count_) * trust, inner = trust - outer;
  const Eigen::ArrayXf luma2 = residual_.col(0).head(count_).square(),
                       chroma2 = 0.5F * (residual_.col(1).head(count_).square() +
                                         residual_.col(2).head(count_).square());
  double all[2] = {0.0, 0.0}, weight[2] = {0.0, 0.0}, squares[2][2] = {};
  for (std::size_t side = 0; side < 2; ++side) {
    const Eigen::ArrayXf& of = side == 0 ? inner : outer;
    weight[side] = of.sum();
    squares[0][side] = (of * luma2).sum();
    squares[1][side] = (of * chroma2).sum();
  }
  for (std::size_t k = 0; k < 2; ++k) {
    all[k] = (squares[k][0] + squares[k][1]) / std::max(1.0, weight[0] + weight[1]);
    for (std::size_t side = 0; side < 2; ++side) {
      // With few pixels the common σ counts as 20 pixels.
      const double variance = (squares[k][side] + 20.0 * all[k]) / (weight[side] + 20.0);
      sigma_[k][side] = std::sqrt(std::max(variance, kLeastSigma * kLeastSigma));
    }
  }
  const auto share = [&](std::size_t k) {
    const float in = static_cast<float>(1.0 / (sigma_[k][0] * sigma_[k][0])),
                out = static_cast<float>(1.0 / (sigma_[k][1] * sigma_[k][1]));
    return Eigen::ArrayXf(in + outer_.head(count_) * (out - in));
  };
  const Eigen::ArrayXf deviation2 = (luma2 * share(0) + 2.0F * chroma2 * share(1)) / 3.0F;
  trust_.head(count_) = (1.0F + deviation2 / static_cast<float>(kTrustedDeviation2)).inverse();
}

/// Adds the normal equations of one channel after elimination of the colours.
void TemplateFit::eliminate(const State& state, int channel) {
  const Eigen::Index regions = model_.regions(), width = regions + kShared + 1;
  const Eigen::Index padded = (count_ + kLanes - 1) / kLanes * kLanes;
  if (rows_.rows() < padded || rows_.cols() != width) rows_.resize((padded + 255) / 256 * 256, width);
  rows_.block(count_, 0, padded - count_, width).setZero();
  if (weight_.size() < count_) weight_.resize(pixels_.u().size());
  const Coverage& coverage = coverageOf(channel);
  const std::size_t k = channel == 0 ? 0 : 1;
  const float in = static_cast<float>(1.0 / sigma_[k][0]), out = static_cast<float>(1.0 / sigma_[k][1]);
  weight_.head(count_) = trust_.head(count_).sqrt() * (in + outer_.head(count_) * (out - in));
  const auto column = [&](Eigen::Index i) { return rows_.col(i).data(); };
  for (const Eigen::Index i : {0, 1, 3}) rows_.col(regions + i).head(count_).setZero();
  for (Eigen::Index r = 0; r < regions; ++r) {
    addGradient(static_cast<float>(state.colours[static_cast<std::size_t>(r)][channel]),
                pixels_.surround().col(channel).data(), weight_.data(),
                {coverage.du.col(r).data(), coverage.dv.col(r).data(), coverage.d_log_sigma.col(r).data()},
                count_, column(regions), column(regions + 1), column(regions + 3));
    rows_.col(r).head(count_) = coverage.value.col(r).head(count_) * weight_.head(count_);
  }
  const Eigen::Vector2f middle = layout_.bounds().centre_m.cast<float>();
  completeGradient(u_.data(), v_.data(), middle.x(), middle.y(), count_, column(regions), column(regions + 1),
                   column(regions + 2), column(regions + 4));
  rows_.col(width - 1).head(count_) = residual_.col(channel).head(count_) * weight_.head(count_);

  Eigen::MatrixXd products(width, width);
  multiplyColumns(rows_.data(), rows_.rows(), width, padded, products.data());
  Eigen::MatrixXd normal = products.topLeftCorner(width - 1, width - 1);
  Eigen::VectorXd right = products.col(width - 1).head(width - 1);
  for (Eigen::Index r = 0; r < regions; ++r) {
    const auto region = static_cast<std::size_t>(r);
    const MarkerPixels::Deep& deep = pixels_.deep()[region];
    normal(r, r) += deep.count * in * in + 1e-2;  // a hidden region keeps its first estimate
    right[r] += (deep.sum[channel] - deep.count * state.colours[region][channel]) * in * in;
  }
  const Eigen::MatrixXd inverse = normal.topLeftCorner(regions, regions).inverse();
  const Eigen::MatrixXd across = normal.topRightCorner(regions, kShared);
  const Eigen::MatrixXd h =
      normal.bottomRightCorner(kShared, kShared) - across.transpose() * inverse * across;
  const Eigen::VectorXd g = right.tail(kShared) - across.transpose() * inverse * right.head(regions);
  const std::array<Eigen::Index, kShared> to{0, 1, 2, channel == 0 ? 3 : 4, 5};
  for (std::size_t i = 0; i < to.size(); ++i) {
    g_[to[i]] += g[static_cast<Eigen::Index>(i)];
    for (std::size_t j = 0; j < to.size(); ++j)
      h_(to[i], to[j]) += h(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
  auto& back = back_[static_cast<std::size_t>(channel)];
  back.resize(regions, kShared + 1);
  back.leftCols(kShared) = inverse * across;
  back.col(kShared) = inverse * right.head(regions);
}

bool TemplateFit::step(State& state, bool free_blur, double& size_px) {
  const double scale_weight = 1.0 / (options_.scale_sigma * options_.scale_sigma);
  h_(5, 5) += scale_weight;
  g_[5] -= scale_weight * state.log_scale;
  for (const Eigen::Index k : {3, 4}) {
    h_(k, k) += free_blur ? 1.0 / (kBlurSpread * kBlurSpread) : 1e12;
    if (free_blur) g_[k] += (std::log(kBlur_px) - state.log_blur[k - 3]) / (kBlurSpread * kBlurSpread);
  }
  if (!free_blur) h_(5, 5) += 1e12;
  Vector by = h_.ldlt().solve(g_);
  if (!by.allFinite()) return false;
  const double metres_per_px = pixels_.metresPerPx(), reach = layout_.reach();
  size_px = std::max(by.head<2>().norm(), std::abs(by[2]) * reach) / metres_per_px;
  const double most_px = 2.0;
  if (size_px > most_px) by *= most_px / size_px;
  for (int channel = 0; channel < 3; ++channel) {
    const auto& back = back_[static_cast<std::size_t>(channel)];
    Eigen::Matrix<double, kShared, 1> own;
    own << by.head<3>(), by[channel == 0 ? 3 : 4], by[5];
    const Eigen::VectorXd change = back.col(kShared) - back.leftCols(kShared) * own;
    for (Eigen::Index r = 0; r < change.size(); ++r)
      state.colours[static_cast<std::size_t>(r)][channel] += change[r];
  }
  state.start_from_base = state.start_from_base * Pose2{by[0], by[1], by[2]};
  state.log_scale = std::clamp(state.log_scale + by[5], -0.3, 0.3);
  for (const Eigen::Index k : {3, 4})
    state.log_blur[k - 3] = std::clamp(state.log_blur[k - 3] + std::clamp(by[k], -0.7, 0.7),
                                       std::log(kLeastBlur_px), std::log(kMostBlur_px));
  // The lens blurs luma and chroma alike, files only the chroma. Without this bound a dark rim around a
  // marker counts as blur of the luma.
  state.log_blur[0] = std::min(state.log_blur[0], state.log_blur[1]);
  return true;
}

/// Pose, covariance and the figures that decide whether this is a marker.
Fit TemplateFit::judge(const Pose2& start, const State& state) const {
  Fit fit;
  fit.map_from_base = start * state.start_from_base;
  fit.metres_per_px = pixels_.metresPerPx();
  fit.visible = std::min(1.0, pixels_.visibleShare());
  fit.scale = std::exp(state.log_scale);
  fit.luma_blur_px = std::exp(state.log_blur[0]);
  fit.chroma_blur_px = std::exp(state.log_blur[1]);
  const Matrix covariance = kCorrelation * kCorrelation * h_.inverse();
  fit.scale_sigma = std::sqrt(covariance(5, 5));
  const double floor = std::pow(options_.pixel_sigma_px * fit.metres_per_px, 2);
  fit.covariance = covariance.topLeftCorner<3, 3>();
  fit.covariance.diagonal() += Eigen::Vector3d(floor, floor, floor / layout_.bounds().half_m.squaredNorm());

  const auto colour = pixels_.colour().topRows(count_);
  const Eigen::Array3f mean = colour.colwise().mean().transpose();
  const double variance = (colour.rowwise() - mean.transpose()).square().rowwise().sum().mean();
  const double contrast = 2.0 * std::sqrt(std::max(variance, 1.0));
  const Eigen::ArrayXf squares = residual_.topRows(count_).square().rowwise().sum();
  const float limit = static_cast<float>(std::pow(kMisfit * contrast, 2));
  double sum = 0.0, fitting = 0.0, misfits = 0.0, outline = 0.0, seen = 0.0;
  fit.regions.resize(static_cast<std::size_t>(model_.regions()));
  for (Eigen::Index i = 0; i < count_; ++i) {
    double covered = 0.0;
    Eigen::Vector3d own(0.0, 0.0, 0.0);
    for (std::size_t r = 0; r < fit.regions.size(); ++r) {
      const double share = luma_.value(i, static_cast<Eigen::Index>(r));
      covered += share;
      own += share * state.colours[r];
      if (squares[i] <= limit) fit.regions[r].visible += share;
    }
    if (covered < 0.25) continue;
    if (covered < 0.75) {
      outline += 1.0;
      const Eigen::Vector3d around = pixels_.surround().row(i).matrix().transpose().cast<double>();
      seen += (own / covered - around).norm() > kLeastContrast ? 1.0 : 0.0;
    }
    // Pixels that show mainly surroundings do not speak against the marker.
    if (covered < 0.5) continue;
    if (squares[i] > limit) {
      misfits += 1.0;
      continue;
    }
    sum += squares[i];
    fitting += 1.0;
  }
  const double pixel_m2 = fit.metres_per_px * fit.metres_per_px;
  for (std::size_t r = 0; r < fit.regions.size(); ++r) {
    const MarkerPixels::Deep& deep = pixels_.deep()[r];
    sum += std::max(0.0, deep.squares - 2.0 * deep.sum.dot(state.colours[r]) +
                             deep.count * state.colours[r].squaredNorm());
    fitting += deep.count;
    misfits += deep.misfits;
    fit.regions[r].visible =
        (fit.regions[r].visible + deep.count) * pixel_m2 / model_.area(static_cast<Eigen::Index>(r));
    fit.regions[r].bgr = bgrFrom(state.colours[r]);
  }
  fit.rms = std::sqrt(sum / std::max(1.0, fitting)) / contrast;
  fit.misfit = misfits / std::max(1.0, fitting + misfits);
  fit.outline = seen / std::max(1.0, outline);
  return fit;
}

}  // namespace omnifleet::markers
