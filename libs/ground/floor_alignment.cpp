#include "ground/floor_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {
namespace {

constexpr double kFar_cells = 5.0;       // displacement beyond which the texture no longer correlates
constexpr double kWidth_cells = 3.0;     // σ of the correlation's peak, for the pull of the fixed pattern
constexpr double kInterpolation = 0.01;  // cells, σ of the error by interpolation between cells
constexpr double kMaxStep_cells = 2.0;
constexpr double kRobust = 2.4;   // σ at which a residual counts half (Cauchy)
constexpr double kMemory = 64.0;  // frames, of the fixed pattern's energy
constexpr float kStrong = 3.0f;   // multiple of the contrast, of values that are compared
constexpr float kOutlier = 6.0f;  // multiple of the contrast, of values that are no texture
constexpr float kSteep = 2.5f;    // multiple of the contrast, gradient per cell with the greatest influence
constexpr int kShifts = 6;        // half a turn: the correlation of opposite shifts is equal but for noise
// Without a prediction the reference is replaced after 2 frames without an estimate, or after 24 with
// estimates that are not valid: the robot stands, or only a pattern fixed in the image is seen.
constexpr int kMaxFailures = 24, kLostFailures = 12;
constexpr int kCandidates = 3;  // of the coarse search
constexpr int kSearch = FloorComparison::kShift, kSearchSide = FloorComparison::kShiftSide;
constexpr int kSubset = FloorBlock::kSubset, kSubsets = FloorBlock::kSubsets, kLanes = FloorBlock::kLanes;
constexpr int kTurns = 6;  // ±0.3 rad
constexpr double kTurnStep_rad = 0.05;

}  // namespace

FloorAlignmentOptions FloorAlignmentOptions::read(const options::Section& section) {
  FloorAlignmentOptions o;
  section.read("inner_m", o.inner_m, {0.05, 2.0});
  section.read("outer_m", o.outer_m, {0.2, 3.0});
  section.read("cell_m", o.cell_m, {0.004, 0.05});
  section.read("reach_m", o.reach_m, {0.05, 1.0});
  section.read("reach_rad", o.reach_rad, {0.05, 1.5});
  section.read("iterations", o.iterations, {3, 100});
  section.read("min_cells", o.min_cells, {100, 100000});
  section.read("min_correlation", o.min_correlation, {0.0, 1.0});
  section.read("min_significance", o.min_significance, {2.0, 100.0});
  section.read("max_sigma_m", o.max_sigma_m, {1e-4, 0.1});
  section.read("scale_sigma", o.scale_sigma, {0.0, 0.2});
  if (o.outer_m < o.inner_m + 0.1) section.fail("outer_m", "must exceed inner_m by 0.1 m");
  section.finish();
  return o;
}

double FloorAlignment::Sums::correlation() const {
  const double norm = current2 * reference2;
  return norm > 0.0 ? both / std::sqrt(norm) : 0.0;
}

FloorAlignment::FloorAlignment(const lens::Camera& camera, const FloorView& view,
                               const FloorAlignmentOptions& options)
    : options_(options), raster_(camera, view, options.inner_m, options.outer_m, options.cell_m) {
  const auto across = static_cast<std::size_t>(raster_.side() / FloorRaster::kBlock);
  blocks_.resize(across * across);
  scores_.resize(blocks_.size());
  for (cv::Mat1f* coarse : {&coarse_reference_, &coarse_, &coarse_turned_}) raster_.makeCoarse(*coarse);
  at_optimum_.resize(blocks_.size());
  shifted_.resize(blocks_.size());
}

void FloorAlignment::forget() {
  has_reference_ = false;
  motion_ = {};
  motion_s_ = 0.0;
  failures_ = 0;
}

Pose2 FloorAlignment::toCells(const Pose2& pose) const {
  return {pose.x_m / options_.cell_m, pose.y_m / options_.cell_m, pose.theta_rad};
}
Pose2 FloorAlignment::toMetres(const Pose2& pose) const {
  return {pose.x_m * options_.cell_m, pose.y_m * options_.cell_m, pose.theta_rad};
}

/// Displacement of the floor in the raster, in the middle of the annulus.
double FloorAlignment::movedCells(const Pose2& pose) const {
  return std::hypot(pose.translation().norm(), middleOfAnnulus() * pose.theta_rad);
}

const FloorAlignment::Result& FloorAlignment::add(TimeNs time, const cv::Mat& image, const cv::Mat1b& objects,
                                                  const std::optional<Pose2>& predicted) {
  raster_.make(image, objects);
  result_ = {};
  is_tracked_ = false;
  if (!has_reference_) {
    if (raster_.cells() >= options_.min_cells) takeReference(time);
    result_.since_ns = time;
    last_ns_ = time;
    return result_;
  }
  result_.since_ns = reference_ns_;
  const Pose2 start = predictedPose(time, predicted);
  if (raster_.cells() >= options_.min_cells) {
    Estimate estimate = align(start);
    if (!predicted && !(estimate.significance >= options_.min_significance)) estimate = search();
    result_.valid = measure(estimate, start, predicted.has_value());
  }
  follow(time, start, predicted.has_value());
  return result_;
}

/// In cells.
Pose2 FloorAlignment::predictedPose(TimeNs time, const std::optional<Pose2>& predicted) const {
  if (predicted) return reference_from_last_ * toCells(*predicted);
  const double passed_s = static_cast<double>(time - last_ns_) * 1e-9;
  const double share = motion_s_ > 0.0 ? std::clamp(passed_s / motion_s_, 0.0, 3.0) : 0.0;
  return reference_from_last_ * Pose2{share * motion_.x_m, share * motion_.y_m, share * motion_.theta_rad};
}

void FloorAlignment::takeReference(TimeNs time) {
  failures_ = 0;
  has_reference_ = true;
  reference_ns_ = time;
  reference_from_last_ = {};
  reference_contrast_ = std::max(1.0f, raster_.contrast());
  raster_.makeCoarse(coarse_reference_);
  used_blocks_ = 0;
  hessian_.setZero();
  hessian_cells_ = 0.0;
  for (int y = 0; y < raster_.side(); y += FloorRaster::kBlock)
    for (int x = 0; x < raster_.side(); x += FloorRaster::kBlock) takeBlock(x, y, blocks_[used_blocks_]);
  hessian_ = Eigen::Matrix3d(hessian_.selfadjointView<Eigen::Upper>());
}

/// Values and gradients of the reference. A block without values is left out.
void FloorAlignment::takeBlock(int x0, int y0, FloorBlock& block) {
  block.rows = 0;
  block.x = x0;
  block.y = y0;
  const auto& values = raster_.values();
  const Eigen::Vector2d& base = raster_.base();
  const float limit = kSteep * reference_contrast_;
  std::array<float, 6> sums{};
  int n = 0;
  for (int i = 0; i < kSubsets * kSubset; ++i) {
    const int odd = i / kSubset, y = y0 + 2 * (i % kSubset / kLanes) + odd, x = x0 + 2 * (i % kLanes) + odd;
    block.value[i] = FloorRaster::kNone;
    block.gx[i] = block.gy[i] = 0.0f;
    if (x == 0 || y == 0 || x + 1 >= values.cols || y + 1 >= values.rows) continue;
    const int left = values(y, x - 1), right = values(y, x + 1), above = values(y - 1, x),
              below = values(y + 1, x);
    if (std::min({static_cast<int>(values(y, x)), left, right, above, below}) == FloorRaster::kNone) continue;
    if (static_cast<float>(std::abs(values(y, x))) > kOutlier * reference_contrast_) continue;
    ++n;
    block.rows |= 1 << (i / kLanes);
    block.value[i] = values(y, x);
    const float along = 0.5f * static_cast<float>(right - left),
                across = 0.5f * static_cast<float>(below - above);
    const float share = 1.0f / (1.0f + (along * along + across * across) / (limit * limit));
    block.gx[i] = share * along;
    block.gy[i] = share * across;
    const auto px = static_cast<float>(x - base.x()), py = static_cast<float>(y - base.y());
    const float turning = px * across - py * along;
    sums[0] += share * along * along;
    sums[1] += share * along * across;
    sums[2] += share * along * turning;
    sums[3] += share * across * across;
    sums[4] += share * across * turning;
    sums[5] += share * turning * turning;
  }
  Eigen::Matrix3d upper;
  upper << sums[0], sums[1], sums[2], 0.0, sums[3], sums[4], 0.0, 0.0, sums[5];
  hessian_ += upper;
  hessian_cells_ += n;
  if (n > 0) ++used_blocks_;
}

void FloorAlignment::compare(const Pose2& pose, int subsets, float gain, float sigma, Sums& sums) {
  const float limit = static_cast<float>(kRobust) * sigma, robust = 1.0f / std::max(1.0f, limit * limit);
  std::array<float, FloorComparison::kTotals> t{};
  FloorComparison(pose, raster_)
      .compare(blocks_.data(), used_blocks_, subsets, gain, robust, scores_.data(), t.data());
  sums.gradient.setZero();
  for (std::size_t b = 0; b < used_blocks_; ++b)
    for (int k = 0; k < 3; ++k) sums.gradient[k] += scores_[b].gradient[k];
  sums.hessian << t[0], 0.5 * t[1], 0.5 * t[2], 0.5 * t[1], t[3], 0.5 * t[4], 0.5 * t[2], 0.5 * t[4], t[5];
  sums.current2 = t[6];
  sums.reference2 = t[7];
  sums.weight = t[8];
  sums.cells = t[9];
  sums.magnitude = t[10];
  sums.both = t[11];
}

/// Gauss–Newton from `start`, first with half of the cells. The last pass remains in `scores_`.
FloorAlignment::Estimate FloorAlignment::align(const Pose2& start) {
  Estimate estimate;
  estimate.pose = start;
  float gain = raster_.contrast() / reference_contrast_, sigma = 1.25f * raster_.contrast();
  int subsets = 1;
  Sums& sums = last_sums_;
  for (int i = 0; i < options_.iterations; ++i) {
    compare(estimate.pose, subsets, gain, sigma, sums);
    if (sums.cells * kSubsets < options_.min_cells * subsets) return estimate;
    const Eigen::Matrix3d own = hessian_ * (sums.weight / hessian_cells_);
    const Eigen::Matrix3d inverse = own.inverse();
    // Share of the reference's gradients that the current raster confirms: the rest is noise.
    const double confirmed =
        std::max((inverse * sums.hessian).trace() / 3.0, 0.25 * static_cast<double>(gain));
    Eigen::Vector3d step = inverse * sums.gradient / confirmed;
    if (!step.allFinite()) return estimate;
    const double length = movedCells(Pose2::fromVector(step));
    if (length > kMaxStep_cells) step *= kMaxStep_cells / length;
    estimate.pose = Pose2::fromVector(step) * estimate.pose;
    if (movedCells(start.inverse() * estimate.pose) > 12.0) return estimate;
    if (subsets == kSubsets && length < 0.06) {
      estimate.converged = true;
      break;
    }
    if (length < 0.1) subsets = kSubsets;
    if (length < 0.5) gain = static_cast<float>(std::max(sums.gain(), 0.0));
    sigma = std::min(sigma, static_cast<float>(1.25 * sums.magnitude / sums.cells));
  }
  if (estimate.converged) estimate.significance = significanceOf(estimate.pose);
  return estimate;
}

void FloorAlignment::correlateAt(const Pose2& pose, std::vector<float>& correlations) const {
  const FloorLimits limits{kStrong * raster_.contrast(), kStrong * reference_contrast_};
  FloorComparison(pose, raster_).correlate(blocks_.data(), used_blocks_, limits, correlations.data());
}

/// Paired test over the blocks: mean difference of the correlations ÷ its standard deviation.
double FloorAlignment::significanceOf(const Pose2& pose) {
  correlateAt(pose, at_optimum_);
  double least = 1e9;
  for (int k = 0; k < kShifts; ++k) {
    const double angle = M_PI * k / kShifts;
    const Pose2 shift{kFar_cells * std::cos(angle), kFar_cells * std::sin(angle), 0.0};
    correlateAt(shift * pose, shifted_);
    double sum = 0.0, squares = 0.0;
    for (std::size_t b = 0; b < used_blocks_; ++b) {
      const double difference = static_cast<double>(at_optimum_[b]) - static_cast<double>(shifted_[b]);
      sum += difference;
      squares += difference * difference;
    }
    const auto n = static_cast<double>(used_blocks_);
    const double variance = (squares - sum * sum / n) * n / std::max(1.0, n - 1.0);
    least = std::min(least, variance > 0.0 ? sum / std::sqrt(variance) : 0.0);
  }
  return least;
}

/// The coarse raster turned and shifted to `pose` in the reference, with zeros where it shows no floor.
void FloorAlignment::turnCoarse(const Pose2& pose) {
  constexpr int kBorder = FloorRaster::kCoarseBorder, kSide = FloorRaster::kCoarse;
  constexpr float kMiddle =
      0.5f * (kSide - 1) - kSide * kBorder;  // fine cells: middle of the first coarse cell
  const FloorWarp warp(pose, raster_.base());
  const int n = coarse_.rows;
  for (int y = kBorder; y < n - kBorder; ++y) {
    for (int x = kBorder; x < n - kBorder; ++x) {
      const float a = kSide * static_cast<float>(x) + kMiddle, b = kSide * static_cast<float>(y) + kMiddle;
      const float u = (warp.c * a + warp.s * b + warp.u - kMiddle) / kSide,
                  v = (warp.c * b - warp.s * a + warp.v - kMiddle) / kSide;
      const int i = std::clamp(cvFloor(u), 0, n - 2), j = std::clamp(cvFloor(v), 0, n - 2);
      const float f = std::clamp(u - static_cast<float>(i), 0.0f, 1.0f),
                  g = std::clamp(v - static_cast<float>(j), 0.0f, 1.0f);
      const float *top = coarse_.ptr<float>(j) + i, *bottom = coarse_.ptr<float>(j + 1) + i;
      coarse_turned_(y, x) =
          (1 - g) * ((1 - f) * top[0] + f * top[1]) + g * ((1 - f) * bottom[0] + f * bottom[1]);
    }
  }
}

/// Coarse search around the last pose, then align() from the best candidates.
FloorAlignment::Estimate FloorAlignment::search() {
  struct Candidate {
    float score = 0.0f;
    Pose2 pose;
  };
  std::array<Candidate, kCandidates> best{};
  raster_.makeCoarse(coarse_);
  std::array<float, kSearchSide * kSearchSide> scores{};
  for (int k = -kTurns; k <= kTurns; ++k) {
    Pose2 middle = reference_from_last_;
    middle.theta_rad += k * kTurnStep_rad;
    turnCoarse(middle);
    FloorComparison::scoreShifts(coarse_reference_, coarse_turned_, scores.data());
    for (int i = 0; i < kSearchSide * kSearchSide; ++i) {
      const float score = scores[static_cast<std::size_t>(i)];
      if (score <= best.back().score) continue;
      constexpr int kSide = FloorRaster::kCoarse;
      best.back() = {score,
                     {middle.x_m + kSide * (i % kSearchSide - kSearch),
                      middle.y_m + kSide * (i / kSearchSide - kSearch), middle.theta_rad}};
      std::sort(best.begin(), best.end(),
                [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    }
  }
  for (const Candidate& candidate : best) {
    if (candidate.score <= 0.0f) continue;
    const Estimate estimate = align(candidate.pose);
    if (estimate.significance >= options_.min_significance) return estimate;
  }
  return {};
}

/// Fills the result from the last pass of align(). @return true if it is valid
bool FloorAlignment::measure(const Estimate& estimate, const Pose2& start, bool has_prediction) {
  result_.cells = static_cast<int>(last_sums_.cells);
  result_.correlation = last_sums_.correlation();
  result_.significance = estimate.significance;
  if (!estimate.converged) return false;
  last_ = estimate.pose;
  result_.reference_from_current = toMetres(estimate.pose);
  is_tracked_ = estimate.significance >= options_.min_significance;
  if (is_tracked_ && (!has_prediction || movedCells(start) >= kFar_cells)) updateFixed(estimate.pose);
  Eigen::Matrix3d covariance;
  if (!findCovariance(covariance)) return false;
  addPull(estimate.pose, start, has_prediction, covariance);
  const double radius = middleOfAnnulus(), scaled = options_.scale_sigma * movedCells(estimate.pose);
  covariance.diagonal() += (kInterpolation * kInterpolation + scaled * scaled) *
                           Eigen::Vector3d(1.0, 1.0, 1.0 / (radius * radius));
  result_.covariance = inCurrentFrame(covariance, estimate.pose);
  const Eigen::Matrix3d& c = result_.covariance;
  const double half = 0.5 * (c(0, 0) + c(1, 1)),
               largest = half + std::hypot(0.5 * (c(0, 0) - c(1, 1)), c(0, 1));
  const double limit = options_.max_sigma_m * options_.max_sigma_m;
  return is_tracked_ && result_.correlation >= options_.min_correlation && largest <= limit &&
         c(2, 2) * options_.outer_m * options_.outer_m <= limit;
}

/// Cluster-robust covariance of the last pass: of the left perturbation, in cells.
bool FloorAlignment::findCovariance(Eigen::Matrix3d& covariance) const {
  const Eigen::LLT<Eigen::Matrix3d> factor(last_sums_.hessian);
  if (factor.info() != Eigen::Success) return false;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (std::size_t b = 0; b < used_blocks_; ++b) {
    const Eigen::Vector3d g = Eigen::Map<const Eigen::Vector3f>(scores_[b].gradient).cast<double>();
    scatter += g * g.transpose();
  }
  const auto n = static_cast<double>(used_blocks_);
  covariance = factor.solve(factor.solve(scatter).transpose()) * (n / std::max(1.0, n - 3.0));
  return covariance.allFinite();
}

/// Adds what the fixed pattern may pull the estimate towards zero motion: its share of the correlated
/// signal, times the motion. Nothing is known about the share before the robot has once moved 5 cm.
void FloorAlignment::addPull(const Pose2& pose, const Pose2& start, bool has_prediction,
                             Eigen::Matrix3d& covariance) const {
  const double signal = last_sums_.both / std::max(1.0, last_sums_.weight);
  const double share = fixed_weight_ > 0.0 ? std::abs(fixed_energy_) / std::max(1e-9, signal) : 1.0;
  const double moved = movedCells(pose), expected = has_prediction ? movedCells(start) : moved;
  const double nearer = std::min(moved, expected) / kWidth_cells;
  double pull = (share < 0.5 ? share / (1.0 - share) : 1.0) * std::exp(-0.5 * nearer * nearer);
  Eigen::Vector3d motion = (expected > moved ? start : pose).vector();
  if (!has_prediction && share >= 0.5 && moved < kFar_cells) {  // any motion is possible
    pull = 1.0;
    motion = Eigen::Vector3d::Constant(options_.reach_m / options_.cell_m);
  }
  covariance += pull * pull * motion * motion.transpose();
}

/// From a covariance of an increment in the reference (cells) to that of one in the current frame (metres).
Eigen::Matrix3d FloorAlignment::inCurrentFrame(const Eigen::Matrix3d& covariance, const Pose2& pose) const {
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = pose.rotation().transpose();
  adjoint.topRightCorner<2, 1>() = adjoint.topLeftCorner<2, 2>() * Eigen::Vector2d(-pose.y_m, pose.x_m);
  const Eigen::Matrix3d to_metres =
      Eigen::Vector3d(options_.cell_m, options_.cell_m, 1.0).asDiagonal() * adjoint;
  return to_metres * covariance * to_metres.transpose();
}

/// Correlation at zero motion, while the texture has moved too far to correlate.
void FloorAlignment::updateFixed(const Pose2& pose) {
  if (movedCells(pose) < kFar_cells || used_blocks_ == 0) return;
  correlateAt({}, shifted_);
  double sum = 0.0;
  for (std::size_t b = 0; b < used_blocks_; ++b) sum += shifted_[b];
  constexpr double kPerCell = 2.0 * kSubsets;  // the first subset contains every fourth cell
  fixed_weight_ = std::min(fixed_weight_ + 1.0, kMemory);
  fixed_energy_ += (sum * kPerCell / raster_.cells() - fixed_energy_) / fixed_weight_;
}

/// Keeps the pose for the next frame, and replaces the reference where it is out of reach.
void FloorAlignment::follow(TimeNs time, const Pose2& predicted, bool has_prediction) {
  const bool use_estimate = result_.valid || (is_tracked_ && !has_prediction);
  const Pose2 pose = use_estimate ? last_ : predicted;
  motion_ = use_estimate || has_prediction ? reference_from_last_.inverse() * pose : Pose2{};
  motion_s_ = static_cast<double>(time - last_ns_) * 1e-9;
  reference_from_last_ = pose;
  last_ns_ = time;
  failures_ = result_.valid || has_prediction ? 0 : failures_ + (is_tracked_ ? 1 : kLostFailures);
  if (raster_.cells() < options_.min_cells) return;
  if (has_prediction && !is_tracked_) updateFixed(pose);
  const bool is_far = pose.translation().norm() > options_.reach_m / options_.cell_m ||
                      std::abs(pose.theta_rad) > options_.reach_rad;
  if (is_far && (use_estimate || has_prediction)) raster_.learnFixed();
  if (is_far || failures_ >= kMaxFailures) takeReference(time);
}

}  // namespace omnifleet::ground
