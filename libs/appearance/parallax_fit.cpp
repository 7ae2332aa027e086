#include "appearance/parallax_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "geometry/pose2.h"

namespace omnifleet::appearance {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr int kLaneRows = 8, kBasis = 16;
constexpr int kLast = ParallaxFit::kBands - 1;
/// Samples per independent value: a band of n frequencies has 2n of them per row, on 4n or more columns.
constexpr double kOversampling = 2.0;
constexpr int kGuard = kLaneRows;  ///< readable values before and after a buffer

}  // namespace

ParallaxOptions ParallaxOptions::read(const options::Section& section) {
  ParallaxOptions o;
  section.read("harmonics", o.harmonics, {0, 7});
  section.read("per_m", o.per_m, {0.01, 100.0});
  section.read("distance_m", o.distance_m, {0.001, 10.0});
  section.read("outlier", o.outlier, {0.1, 1000.0});
  section.read("iterations", o.iterations, {1, 50});
  section.read("converged_deg", o.converged_deg, {1e-6, 1.0});
  section.read("sigma_factor", o.sigma_factor, {0.1, 100.0});
  section.read("sigma_share", o.sigma_share, {0.0, 10.0});
  section.read("sigma_floor_deg", o.sigma_floor_deg, {0.001, 10.0});
  section.read("mismatch", o.mismatch, {0.001, 100.0});
  section.read("least_contrast", o.least_contrast, {0.0, 255.0});
  section.read("fewest_sectors", o.fewest_sectors, {0.0, 16.0});
  section.finish();
  return o;
}

ParallaxFit::ParallaxFit(const ParallaxOptions& options)
    : options_(options), parameters_(2 + 2 * options.harmonics) {
  for (int band = 0; band < kBands; ++band) {
    const int columns = kColumns[static_cast<std::size_t>(band)];
    auto& basis = basis_[static_cast<std::size_t>(band)];
    basis.assign(static_cast<std::size_t>(columns * kBasis), 0.0f);
    for (int c = 0; c < columns; ++c) {
      const double bearing = 2.0 * M_PI * c / columns;
      float* u = basis.data() + c * kBasis;
      u[0] = 1.0f;
      for (int k = 1; k <= options.harmonics; ++k) {
        u[k] = static_cast<float>(std::cos(k * bearing));
        u[options.harmonics + k] = static_cast<float>(std::sin(k * bearing));
      }
    }
  }
}

void ParallaxFit::prepare(const Eigen::ArrayXXcf& spectrum, const Eigen::ArrayXf& weight, View& view) const {
  const int rows = static_cast<int>(spectrum.rows()), known = static_cast<int>(spectrum.cols());
  view.rows = rows;
  view.padded = (rows + kLaneRows - 1) / kLaneRows * kLaneRows;
  const float norm = spectrum.leftCols(std::min(known, kFrequencies[kLast])).matrix().norm();
  const float scale = norm > 0.0f ? 1.0f / norm : 0.0f;
  view.norm = static_cast<double>(norm);
  cv::Mat1f packed, grey;
  for (std::size_t band = 0; band < kBands; ++band) {
    const int columns = kColumns[band], frequencies = std::min(kFrequencies[band], known);
    packed.create(rows, columns);
    packed.setTo(0.0f);
    for (int row = 0; row < rows; ++row) {
      float* out = packed[row];
      for (int k = 1; k <= frequencies; ++k) {
        out[2 * k - 1] = scale * spectrum(row, k - 1).real();
        out[2 * k] = scale * spectrum(row, k - 1).imag();
      }
    }
    cv::idft(packed, grey, cv::DFT_ROWS | cv::DFT_REAL_OUTPUT);
    auto& cells = view.grey[band];
    cells.assign(static_cast<std::size_t>(columns * view.padded), 0.0f);
    for (int row = 0; row < rows; ++row) {
      const float* in = grey[row];
      for (int c = 0; c < columns; ++c) cells[static_cast<std::size_t>(c * view.padded + row)] = in[c];
    }
    auto& weights = view.weight[band];
    weights.resize(static_cast<std::size_t>(columns));
    for (int c = 0; c < columns; ++c)
      weights[static_cast<std::size_t>(c)] = weight[c * weight.size() / columns];
  }
}

void ParallaxFit::shape(const View& view, double bearing_rad, const Band& elevations) {
  bearing_rad_ = bearing_rad;
  rows_ = view.rows;
  const auto padded = static_cast<std::size_t>(view.padded);
  gradient_.above.assign(padded, 0.0f);
  gradient_.here.assign(padded, 0.0f);
  gradient_.below.assign(padded, 0.0f);
  const double row_rad = (elevations.most_rad - elevations.least_rad) / view.rows;
  for (int row = 0; row < view.rows && view.rows > 1; ++row) {
    const auto r = static_cast<std::size_t>(row);
    const int from = std::max(row - 1, 0), to = std::min(row + 1, view.rows - 1);
    const auto factor =
        static_cast<float>((elevations.most_rad - (row + 0.5) * row_rad) / (row_rad * (to - from)));
    (from < row ? gradient_.above : gradient_.here)[r] += factor;
    (to > row ? gradient_.below : gradient_.here)[r] -= factor;
  }
  const std::size_t cells = padded * static_cast<std::size_t>(kColumns[kLast]);
  if (a_.size() != cells) {
    a_.assign(cells, 0.0f);
    b_ = difference_ = a_;
    mean_.assign(cells + 2 * kGuard, 0.0f);
    for (auto* values : {&shift_, &parallax_, &sine_, &cosine_, &weight_, &information_})
      values->assign(static_cast<std::size_t>(kColumns[kLast]), 0.0f);
    sums_.resize(static_cast<std::size_t>(kColumns[kLast]));
  }
}

void ParallaxFit::warp(const View& from, const View& to, int band) {
  const auto index = static_cast<std::size_t>(band);
  const int columns = kColumns[index];
  const double per_rad = columns / (2.0 * M_PI);
  for (int c = 0; c < columns; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const float* u = basis_[index].data() + c * kBasis;
    double p = 0.0;
    for (int j = 0; j + 1 < parameters_; ++j) p += state_[j + 1] * static_cast<double>(u[j]);
    parallax_[k] = static_cast<float>(p);
    shift_[k] = static_cast<float>(0.5 * per_rad * (state_[0] + p * static_cast<double>(sine_[k])));
  }
  moveColumns(from.grey[index].data(), from.padded, columns, shift_.data(), 1.0f, a_.data());
  moveColumns(to.grey[index].data(), to.padded, columns, shift_.data(), -1.0f, b_.data());
  meanAndDifference(a_.data(), b_.data(), columns * from.padded, mean_.data() + kGuard, difference_.data());
  sumColumns(mean_.data() + kGuard, difference_.data(), from.padded, columns, static_cast<float>(per_rad),
             gradient_, parallax_.data(), sine_.data(), cosine_.data(), sums_.data());
}

/// Weights of the columns: visible in both panoramas, and less where the residual is large.
void ParallaxFit::weigh(const View& from, const View& to, int band) {
  const auto index = static_cast<std::size_t>(band);
  const int columns = kColumns[index], mask = columns - 1;
  double sum = 0.0, seen = 0.0;
  for (int c = 0; c < columns; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const int moved = static_cast<int>(std::lround(shift_[k]));
    weight_[k] = from.weight[index][static_cast<std::size_t>((c + moved) & mask)] *
                 to.weight[index][static_cast<std::size_t>((c - moved) & mask)];
    sum += static_cast<double>(weight_[k] * sums_[k].rr);
    seen += static_cast<double>(weight_[k]);
  }
  const double limit = options_.outlier * (seen > 0.0 ? sum / seen : 0.0);
  double robust = 0.0, count = 0.0;
  for (int c = 0; c < columns; ++c) {
    const auto k = static_cast<std::size_t>(c);
    if (limit > 0.0) weight_[k] /= 1.0f + sums_[k].rr / static_cast<float>(limit);
    robust += static_cast<double>(weight_[k] * sums_[k].rr);
    count += static_cast<double>(weight_[k]);
  }
  variance_ = count > 0.0 ? robust / (count * rows_) : 0.0;
}

/// One Gauss–Newton step. @return change of the turn, radians
double ParallaxFit::step(int band, double prior_sigma) {
  const auto index = static_cast<std::size_t>(band);
  const int columns = kColumns[index], series = parameters_ - 1;
  const float* basis = basis_[index].data();
  Matrix normal = Matrix::Zero();
  Vector right = Vector::Zero();
  for (int c = 0; c < columns; ++c) {
    const ColumnSums& s = sums_[static_cast<std::size_t>(c)];
    const float w = weight_[static_cast<std::size_t>(c)];
    normal(0, 0) += static_cast<double>(w * s.gg);
    right[0] += static_cast<double>(w * s.gr);
    for (int j = 0; j < series; ++j) {
      normal(0, j + 1) += static_cast<double>(w * s.gt * basis[c * kBasis + j]);
      right[j + 1] += static_cast<double>(w * s.tr * basis[c * kBasis + j]);
    }
  }
  for (int c = 0; c < columns; ++c)
    information_[static_cast<std::size_t>(c)] =
        weight_[static_cast<std::size_t>(c)] * sums_[static_cast<std::size_t>(c)].tt;
  float products[kBasis * kBasis];
  sumProducts(basis, information_.data(), columns, products);
  const double ridge = kOversampling * variance_ / (prior_sigma * prior_sigma);
  for (int i = 0; i < series; ++i) {
    for (int j = 0; j < series; ++j) normal(i + 1, j + 1) = static_cast<double>(products[i * kBasis + j]);
    normal(i + 1, 0) = normal(0, i + 1);
    normal(i + 1, i + 1) += ridge;
    right[i + 1] -= ridge * state_[i + 1];
  }
  // Keeps the matrix regular where nothing is seen.
  for (int i = 0; i < kParameters; ++i) normal(i, i) += i < parameters_ ? 1e-12 : 1.0;
  const Eigen::LDLT<Matrix> solver(normal);
  const Vector change = solver.solve(right);
  inverse_ = solver.solve(Matrix::Identity());
  state_ += change;
  return std::abs(change[0]);
}

double ParallaxFit::matchOfSectors() const {
  const int columns = kColumns[kLast], per_sector = columns / kSectors;
  const auto padded = a_.size() / static_cast<std::size_t>(columns);
  double sum = 0.0, total = 0.0;
  for (int sector = 0; sector < kSectors; ++sector) {
    const auto cells = static_cast<std::size_t>(per_sector) * padded;
    const Eigen::Map<const Eigen::ArrayXf> a(a_.data() + static_cast<std::size_t>(sector) * cells,
                                             static_cast<Eigen::Index>(cells)),
        b(b_.data() + static_cast<std::size_t>(sector) * cells, static_cast<Eigen::Index>(cells));
    const double aa = static_cast<double>(a.square().sum()), bb = static_cast<double>(b.square().sum()),
                 ab = static_cast<double>((a * b).sum()), power = std::sqrt(aa * bb),
                 weight = std::sqrt(power);
    if (!(power > 0.0)) continue;
    sum += weight * std::max(0.0, ab / power);
    total += weight;
  }
  return total > 0.0 ? sum / total : 0.0;
}

/// Change of the turn by residuals in one column, given their products with the gradient over the bearing and
/// with the change by parallax.
double ParallaxFit::turnBy(int column, double residual_gg, double residual_gt) const {
  const float* u = basis_[kLast].data() + column * kBasis;
  double series = 0.0;
  for (int j = 0; j + 1 < parameters_; ++j) series += inverse_(0, j + 1) * static_cast<double>(u[j]);
  return static_cast<double>(weight_[static_cast<std::size_t>(column)]) *
         (inverse_(0, 0) * residual_gg + series * residual_gt);
}

/// ∂s/∂h = −p(b) cos(b − h).
double ParallaxFit::turnByBearing() const {
  double change = 0.0;
  for (int c = 0; c < kColumns[kLast]; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const double shift = -static_cast<double>(parallax_[k] * cosine_[k]);
    change -= turnBy(c, static_cast<double>(sums_[k].gg) * shift, static_cast<double>(sums_[k].gt) * shift);
  }
  return change;
}

/// Root of the sum over the sectors of the squared change of the turn by a change of p in the sector that the
/// series cannot follow.
double ParallaxFit::sensitivity() const {
  const int columns = kColumns[kLast], per_sector = columns / kSectors;
  double sum = 0.0;
  for (int sector = 0; sector < kSectors; ++sector) {
    double change = 0.0;
    for (int c = sector * per_sector; c < (sector + 1) * per_sector; ++c) {
      const ColumnSums& s = sums_[static_cast<std::size_t>(c)];
      change += turnBy(c, static_cast<double>(s.gt), static_cast<double>(s.tt));
    }
    sum += change * change;
  }
  return std::sqrt(sum);
}

int ParallaxFit::sectorsWithContrast(double norm) const {
  constexpr int kPerSector = kColumns[kLast] / kSectors;
  const double least = options_.least_contrast / norm * kColumns[kLast] / (2.0 * M_PI);  // per radian
  int count = 0;
  for (int sector = 0; sector < kSectors; ++sector) {
    double squares = 0.0;
    for (int c = sector * kPerSector; c < (sector + 1) * kPerSector; ++c)
      squares += static_cast<double>(sums_[static_cast<std::size_t>(c)].gg);
    if (squares > least * least * kPerSector * rows_) ++count;
  }
  return count;
}

double ParallaxFit::parallax(int band) const {
  double sum = 0.0;
  const int columns = kColumns[static_cast<std::size_t>(band)];
  for (int c = 0; c < columns; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const auto moved = static_cast<double>(parallax_[k] * sine_[k]);
    sum += moved * moved;
  }
  return std::sqrt(sum / columns);
}

ParallaxFit::Result ParallaxFit::solve(const View& from, const View& to, double turn_rad, double bearing_rad,
                                       double distance_m, const Band& elevations) {
  Result result;
  shape(from, bearing_rad, elevations);
  state_.setZero();
  state_[0] = turn_rad;
  const double distance = distance_m >= 0.0 ? distance_m : options_.distance_m,
               prior_sigma = std::max(options_.per_m * distance, 1e-4);
  for (int band = 0; band < kBands; ++band) {
    const int columns = kColumns[static_cast<std::size_t>(band)];
    for (int c = 0; c < columns; ++c) {
      const double angle = 2.0 * M_PI * c / columns - bearing_rad;
      sine_[static_cast<std::size_t>(c)] = static_cast<float>(std::sin(angle));
      cosine_[static_cast<std::size_t>(c)] = static_cast<float>(std::cos(angle));
    }
    for (int k = 0; k < options_.iterations; ++k) {
      warp(from, to, band);
      weigh(from, to, band);
      if (step(band, prior_sigma) < options_.converged_deg * kDegree) break;
    }
  }
  warp(from, to, kLast);
  result.turn_rad = wrapAngle(state_[0]);
  result.match = matchOfSectors();
  result.parallax_rad = parallax(kLast);
  const double fit = options_.sigma_factor * std::sqrt(kOversampling * variance_ * inverse_(0, 0)),
               model = options_.sigma_share * result.parallax_rad * sensitivity(),
               floor = options_.sigma_floor_deg * kDegree;
  result.turn_by_bearing = turnByBearing();
  result.sectors = sectorsWithContrast(std::sqrt(from.norm * to.norm));
  const double few = std::max(1.0, options_.fewest_sectors / std::max(result.sectors, 1)),
               mismatch = 1.0 + std::pow(std::max(0.0, 1.0 - result.match) / options_.mismatch, 1.5);
  result.sigma_rad = few * few * few * mismatch * std::sqrt(fit * fit + model * model + floor * floor);
  result.valid = std::isfinite(result.turn_rad) && std::isfinite(result.sigma_rad);
  return result;
}

}  // namespace omnifleet::appearance
