#include "scan/line_scan.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace omnifleet::scan {
namespace {

constexpr int kWidest = 20;
constexpr int kHalfWidths[] = {kWidest, 10, 5, 3, 2};
constexpr double kMostChi2 = 2.0;       // per degree of freedom
constexpr double kOutlier = 3.0;        // σ of a beam off its own line
constexpr int kFewest = 4;              // beams; three fit almost anything
constexpr double kFilled = 0.7;         // share of a window's beams that measured something
constexpr double kLeastInverse = 0.02;  // 1/m: 50 m
constexpr double kNoiseLow = 0.5, kNoiseHigh = 4.0;

}  // namespace

void LineScan::prepareBearings(std::size_t count) {
  if (bearings_.size() == count) return;
  bearings_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(count);
    bearings_[i] = {static_cast<float>(std::cos(bearing)), static_cast<float>(std::sin(bearing))};
  }
}

/// Second differences of a line's inverse ranges vanish: their median shows the noise alone.
void LineScan::scaleNoise() {
  constexpr std::size_t kFewest = 30;
  constexpr double kMedianToSigma = 1.4826;
  const std::size_t n = beams_.size();
  second_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const Beam &a = beams_[i], &b = beams_[(i + 1) % n], &c = beams_[(i + 2) % n];
    if (a.sigma > 0 && b.sigma > 0 && c.sigma > 0)
      second_.push_back(std::abs(a.s - 2.0f * b.s + c.s) / b.sigma);
  }
  noise_scale_ = 1.0;
  if (second_.size() < kFewest) return;
  const auto middle = second_.begin() + static_cast<std::ptrdiff_t>(second_.size() / 2);
  std::nth_element(second_.begin(), middle, second_.end());
  noise_scale_ = std::clamp(kMedianToSigma * *middle / std::sqrt(6.0), kNoiseLow, kNoiseHigh);
  for (Beam& beam : beams_) beam.sigma *= static_cast<float>(noise_scale_);
}

void LineScan::sumUp() {
  const int n = static_cast<int>(beams_.size()), total = n + 4 * kWidest + 1;
  prefix_.resize(static_cast<std::size_t>(total) + 1);
  prefix_[0] = {};
  for (int k = 0; k < total; ++k) {
    Sums sums = prefix_[static_cast<std::size_t>(k)];
    const auto i = static_cast<std::size_t>((k - 2 * kWidest + 4 * n) % n);
    const Beam& beam = beams_[i];
    if (beam.sigma > 0) {
      const double weight = 1.0 / (static_cast<double>(beam.sigma) * beam.sigma), c = bearings_[i].x(),
                   s = bearings_[i].y(), y = beam.s;
      sums.cc += weight * c * c;
      sums.cs += weight * c * s;
      sums.ss += weight * s * s;
      sums.cy += weight * c * y;
      sums.sy += weight * s * y;
      sums.yy += weight * y * y;
      ++sums.n;
    }
    prefix_[static_cast<std::size_t>(k) + 1] = sums;
  }
}

/// Of beams from ≤ i < to; both may lie up to 2·kWidest outside of the circle.
LineScan::Sums LineScan::window(int from, int to) const {
  return prefix_[static_cast<std::size_t>(to + 2 * kWidest)] -
         prefix_[static_cast<std::size_t>(from + 2 * kWidest)];
}

void LineScan::fitBeam(int i) {
  Beam& beam = beams_[static_cast<std::size_t>(i)];
  if (!(beam.sigma > 0)) return;
  const Eigen::Vector2d u = bearings_[static_cast<std::size_t>(i)].cast<double>();
  for (const int half : kHalfWidths) {
    double best = kMostChi2;
    for (const int shift : {0, -half, half}) {
      const Sums sums = window(i + shift - half, i + shift + half + 1);
      if (sums.n < std::max(kFewest, static_cast<int>(kFilled * (2 * half + 1)))) continue;
      Eigen::Matrix2d information;
      information << sums.cc, sums.cs, sums.cs, sums.ss;
      if (!(information.determinant() > 1e-9 * sums.cc * sums.ss)) continue;
      const Eigen::Matrix2d covariance = information.inverse();
      const Eigen::Vector2d moment(sums.cy, sums.sy), line = covariance * moment;
      const double chi2 = std::max(0.0, sums.yy - moment.dot(line)) / (sums.n - 2);
      const double predicted = line.dot(u);
      if (!(chi2 < best) || predicted < kLeastInverse) continue;
      if (std::abs(static_cast<double>(beam.s) - predicted) > kOutlier * static_cast<double>(beam.sigma))
        continue;
      best = chi2;
      beam.has_line = true;
      beam.line = line.cast<float>();
      beam.line_covariance = (std::max(1.0, chi2) * covariance).cast<float>();
      beam.point_m = (u / predicted).cast<float>();
    }
    if (beam.has_line) return;
  }
}

void LineScan::addBearingError(std::size_t i, double sigma_rad) {
  Beam& beam = beams_[i];
  const Eigen::Vector2f& u = bearings_[i];
  const double by_bearing = sigma_rad * static_cast<double>(beam.line.dot(Eigen::Vector2f(-u.y(), u.x()))),
               variance = static_cast<double>(beam.sigma) * beam.sigma,
               sum = variance + by_bearing * by_bearing;
  beam.line_covariance *= static_cast<float>(sum / variance);
  beam.sigma = static_cast<float>(std::sqrt(sum));
}

void LineScan::fit(const Boundary& boundary, const std::vector<bool>& usable, double bearing_sigma_rad) {
  const std::size_t n = boundary.inverse_m.size();
  prepareBearings(n);
  beams_.assign(n, Beam{});
  lines_ = 0;
  mean_range_m_ = median_sigma_m_ = 0.0;
  if (n <= 4 * kWidest) return;
  for (std::size_t i = 0; i < n; ++i) {
    const float s = boundary.inverse_m[i], sigma = boundary.sigma[i];
    if (!std::isfinite(s) || !(s > 0) || !(sigma > 0) || (!usable.empty() && !usable[i])) continue;
    beams_[i].s = s;
    beams_[i].sigma = sigma;
  }
  scaleNoise();
  sumUp();
  for (std::size_t i = 0; i < n; ++i) {
    fitBeam(static_cast<int>(i));
    if (bearing_sigma_rad > 0 && beams_[i].has_line) addBearingError(i, bearing_sigma_rad);
    lines_ += beams_[i].has_line ? 1 : 0;
  }
  summarise();
}

void LineScan::summarise() {
  mean_range_m_ = median_sigma_m_ = 0.0;
  if (lines_ == 0) return;
  second_.clear();
  for (const Beam& beam : beams_) {
    if (!beam.has_line) continue;
    mean_range_m_ += 1.0 / static_cast<double>(beam.s);
    second_.push_back(beam.sigma / (beam.s * beam.s));
  }
  mean_range_m_ /= static_cast<double>(lines_);
  const auto middle = second_.begin() + static_cast<std::ptrdiff_t>(second_.size() / 2);
  std::nth_element(second_.begin(), middle, second_.end());
  median_sigma_m_ = static_cast<double>(*middle);
}

Eigen::Matrix3d LineScan::information(const std::vector<std::uint8_t>& skip) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const Beam& beam = beams_[i];
    if (!beam.has_line || (!skip.empty() && skip[i] != 0)) continue;
    const Eigen::Vector2d a = beam.line.cast<double>(), u = bearings_[i].cast<double>();
    // s = a·u; a shift t of the scan turns a into a / (1 − a·t), a turn δ turns u.
    const double s = a.dot(u);
    const Eigen::Vector3d jacobian(s * a.x(), s * a.y(), a.dot(Eigen::Vector2d(-u.y(), u.x())));
    const double sigma = static_cast<double>(beam.sigma);
    sum += jacobian * jacobian.transpose() / (sigma * sigma);
  }
  return sum;
}

std::uint64_t LineScan::sectors() const {
  constexpr std::size_t kSectors = 64;
  std::uint64_t sectors = 0;
  for (std::size_t i = 0; i < beams_.size(); ++i)
    if (beams_[i].sigma > 0) sectors |= std::uint64_t{1} << (i * kSectors / beams_.size());
  return sectors;
}

void LineScan::compact() {
  prefix_ = {};
  second_ = {};
}

}  // namespace omnifleet::scan
