#include "scan/place_grid.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::scan {
namespace {

constexpr std::size_t kMostCells = std::size_t{1} << 22U;
constexpr double kMostSigmaCells = 3.0;
constexpr int kKernels = 4;           // σ of kSigma, kSigma + 0.5, … cells
constexpr double kCore = 0.5;         // cells around a surface with likelihood 1
constexpr double kSigma = 1.25;       // cells; of a surface that is known exactly
constexpr double kBody_m = 0.2;       // around a scanner: free
constexpr double kMostGap_m = 1.0;    // between neighbouring beams of one surface
constexpr double kFreeMargin = 1.0;   // cells before a surface that count as free from the scanner's side
constexpr double kReachSigmas = 2.0;  // of a kernel

Eigen::Vector2d pointOf(const LineScan& scan, std::size_t i) {
  return scan.bearings()[i].cast<double>() / static_cast<double>(scan.beams()[i].s);
}

/// Distance of a point to the line of a beam, metres.
double offLine(const LineScan::Beam& beam, const Eigen::Vector2d& point) {
  const Eigen::Vector2d line = beam.line.cast<double>();
  return std::abs(line.dot(point) - 1.0) / line.norm();
}

/// The code of two windows together.
std::uint8_t mergeCodes(std::uint8_t a, std::uint8_t b) {
  const auto plain = [](std::uint8_t c) {  // if a cell of the windows is unknown
    return static_cast<std::uint8_t>(c < PlaceGrid::kKnown  ? c
                                     : c < PlaceGrid::kZero ? 0
                                                            : c - PlaceGrid::kZero);
  };
  const std::uint8_t known = std::max(a, b), mixed = std::max(plain(a), plain(b));
  return std::min(a, b) >= PlaceGrid::kKnown ? known : mixed;
}

}  // namespace

bool PlaceGrid::usable(const LineScan::Beam& beam, double max_range_m, double cell_m) {
  if (!(beam.s > 0) || !(beam.sigma > 0)) return false;
  const double range_m = 1.0 / static_cast<double>(beam.s);
  return range_m <= max_range_m &&
         static_cast<double>(beam.sigma) * range_m * range_m <= kMostSigmaCells * cell_m;
}

/// The ends of the beams, and the surface between neighbouring beams that lie on each other's line.
void PlaceGrid::findSurfaces(const Reference& reference, double max_range_m) {
  const LineScan& scan = *reference.scan;
  const std::size_t n = scan.beams().size();
  for (std::size_t i = 0; i < n; ++i) {
    const LineScan::Beam &beam = scan.beams()[i], &next = scan.beams()[(i + 1) % n];
    if (!usable(beam, max_range_m, cell_m_)) continue;
    const Eigen::Vector2d point = pointOf(scan, i);
    const double sigma_m = static_cast<double>(beam.sigma) * point.squaredNorm();
    points_.push_back({reference.map_from_scan * point, sigma_m});
    if (!beam.has_line || !next.has_line || !usable(next, max_range_m, cell_m_)) continue;
    const Eigen::Vector2d after = pointOf(scan, (i + 1) % n);
    const double gap_m = (after - point).norm();
    if (gap_m > kMostGap_m || std::max(offLine(beam, after), offLine(next, point)) > cell_m_) continue;
    const int parts = static_cast<int>(gap_m / cell_m_);
    for (int k = 1; k <= parts; ++k) {
      const double share = static_cast<double>(k) / (parts + 1);
      points_.push_back({reference.map_from_scan * ((1.0 - share) * point + share * after), sigma_m});
    }
  }
}

/// Chooses corner, size and cell so that all points and scanners lie in the grid, with a margin on all sides.
void PlaceGrid::layOut(const std::vector<Reference>& references, int margin) {
  Eigen::Vector2d least = points_.front().map_m, most = least;
  const auto add = [&](const Eigen::Vector2d& p) {
    least = least.cwiseMin(p);
    most = most.cwiseMax(p);
  };
  for (const Point& point : points_) add(point.map_m);
  for (const Reference& reference : references) add(reference.map_from_scan.translation());
  for (;; cell_m_ *= 2.0) {
    const Eigen::Vector2d cells = (most - least) / cell_m_ + Eigen::Vector2d::Constant(2.0 * margin + 2.0);
    if (cells.x() * cells.y() > static_cast<double>(kMostCells)) continue;
    width_ = static_cast<unsigned>(cells.x());
    height_ = static_cast<unsigned>(cells.y());
    break;
  }
  size_ = static_cast<std::size_t>(width_) * height_;
  corner_m_ = least - Eigen::Vector2d::Constant(margin * cell_m_);
  low_ = Eigen::Vector2i::Constant(margin);
  high_ = inCells(most).cast<int>();
}

void PlaceGrid::makeKernels() {
  kernels_.resize(kKernels);
  for (int k = 0; k < kKernels; ++k) {
    const double sigma = kSigma + 0.5 * k;  // cells
    Kernel& kernel = kernels_[static_cast<std::size_t>(k)];
    kernel.radius = static_cast<int>(std::floor(kCore + kReachSigmas * sigma));
    kernel.values.clear();
    for (int y = -kernel.radius; y <= kernel.radius; ++y) {
      for (int x = -kernel.radius; x <= kernel.radius; ++x) {
        const double excess = std::max(0.0, std::hypot(x, y) - kCore) / sigma;
        const double value = excess > kReachSigmas ? 0.0 : std::exp(-0.5 * excess * excess);
        kernel.values.push_back(static_cast<std::uint8_t>(std::lround(kUnit * value)));
      }
    }
  }
}

/// Raises the likelihood around a point. The margin of the grid is wider than every kernel.
void PlaceGrid::stamp(const Point& point) {
  const Eigen::Vector2i at = inCells(point.map_m).cast<int>();
  const double sigma = std::hypot(kSigma, point.sigma_m / cell_m_);
  const int k = std::clamp(static_cast<int>(std::lround(2.0 * (sigma - kSigma))), 0, kKernels - 1);
  const std::size_t centre = static_cast<std::size_t>(at.y()) * width_ + static_cast<std::size_t>(at.x());
  if (stamped_[centre] > k) return;  // by a kernel at least as wide
  stamped_[centre] = static_cast<std::uint8_t>(k + 1);
  const Kernel& kernel = kernels_[static_cast<std::size_t>(k)];
  const std::uint8_t* value = kernel.values.data();
  for (int y = at.y() - kernel.radius; y <= at.y() + kernel.radius; ++y) {
    std::uint8_t* row = cells_.data() + static_cast<std::size_t>(y) * width_ + (at.x() - kernel.radius);
    for (int x = 0; x <= 2 * kernel.radius; ++x, ++row, ++value) *row = std::max(*row, *value);
  }
}

/// Fills the star-shaped polygon of the beams, shortened to the shortest of three neighbours.
void PlaceGrid::markFree(const Reference& reference, double max_range_m) {
  const LineScan& scan = *reference.scan;
  const std::size_t n = scan.beams().size();
  const Eigen::Vector2d scanner = inCells(reference.map_from_scan.translation());
  outline_.assign(n, scanner);
  for (std::size_t i = 0; i < n; ++i) {
    if (!usable(scan.beams()[i], max_range_m, cell_m_)) continue;
    float s = 0.0f;
    for (const std::size_t k : {(i + n - 1) % n, i, (i + 1) % n})
      if (usable(scan.beams()[k], max_range_m, cell_m_)) s = std::max(s, scan.beams()[k].s);
    const double range = std::max(0.0, 1.0 / (static_cast<double>(s) * cell_m_) - kFreeMargin);
    outline_[i] += reference.map_from_scan.rotation() * (range * scan.bearings()[i].cast<double>());
  }
  crossings_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    Eigen::Vector2d a = outline_[i], b = outline_[(i + 1) % n];
    if (a.y() > b.y()) std::swap(a, b);
    const int first = static_cast<int>(std::ceil(a.y() - 0.5)),
              end = static_cast<int>(std::ceil(b.y() - 0.5));
    if (first >= end) continue;
    const double slope = (b.x() - a.x()) / (b.y() - a.y());
    for (int row = first; row < end; ++row)
      crossings_.emplace_back(row, static_cast<float>(a.x() + slope * (row + 0.5 - a.y())));
  }
  std::sort(crossings_.begin(), crossings_.end());
  for (std::size_t k = 0; k + 1 < crossings_.size(); k += 2) {
    const auto from = static_cast<int>(std::ceil(crossings_[k].second - 0.5f)),
               end = static_cast<int>(std::ceil(crossings_[k + 1].second - 0.5f));
    std::uint8_t* row = free_.data() + static_cast<std::size_t>(crossings_[k].first) * width_;
    if (end > from) std::fill(row + from, row + end, std::uint8_t{1});
  }
}

/// A surface outweighs free space: a wall seen at a grazing angle stays.
void PlaceGrid::combine(double free_weight) {
  // At least one unit, so that free space differs from the rim of a surface.
  const int lost = std::max(1, static_cast<int>(std::lround(kUnit * free_weight)));
  const auto free_code = static_cast<std::uint8_t>(kZero - std::min(lost, kUnit));
  for (std::size_t c = 0; c < size_; ++c) {
    if (cells_[c] > 0)
      cells_[c] = static_cast<std::uint8_t>(kZero + cells_[c]);
    else
      cells_[c] = free_[c] != 0 ? free_code : std::uint8_t{0};
  }
}

/// The scanner's body was in free space, also behind a scanner with a narrow field of view.
void PlaceGrid::markBody(const Reference& reference) {
  const Eigen::Vector2d scanner = inCells(reference.map_from_scan.translation());
  const double radius = std::min(kBody_m / cell_m_, static_cast<double>(low_.x()) - 1.0);
  for (int y = static_cast<int>(scanner.y() - radius); y <= scanner.y() + radius; ++y)
    for (int x = static_cast<int>(scanner.x() - radius); x <= scanner.x() + radius; ++x)
      if ((Eigen::Vector2d(x + 0.5, y + 0.5) - scanner).norm() <= radius)
        free_[static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x)] = 1;
}

/// Layer `to` from layer `from`: four windows, `step` cells apart, make one. Outside the grid all is 0.
template <typename Merge>
void PlaceGrid::reduce(std::vector<std::uint8_t>& cells, int from, int to, int step_cells,
                       const Merge& merge) const {
  const auto step = static_cast<std::size_t>(step_cells);
  const std::uint8_t* below = cells.data() + static_cast<std::size_t>(from) * size_;
  std::uint8_t* here = cells.data() + static_cast<std::size_t>(to) * size_;
  for (std::size_t y = 0; y < height_; ++y) {  // two windows side by side
    const std::uint8_t* in = below + y * width_;
    std::uint8_t* out = here + y * width_;
    const std::size_t inner = width_ > step ? width_ - step : 0;
    for (std::size_t x = 0; x < inner; ++x) out[x] = merge(in[x], in[x + step]);
    for (std::size_t x = inner; x < width_; ++x) out[x] = merge(in[x], std::uint8_t{0});
  }
  for (std::size_t y = 0; y < height_; ++y) {  // two of these, one above the other; rows in ascending order
    std::uint8_t* out = here + y * width_;
    const std::uint8_t* above = y + step < height_ ? out + step * width_ : nullptr;
    for (std::size_t x = 0; x < width_; ++x)
      out[x] = merge(out[x], above == nullptr ? std::uint8_t{0} : above[x]);
  }
}

void PlaceGrid::reduceAll(int levels) {
  std::copy_n(cells_.begin(), size_, cells_.begin() + static_cast<std::ptrdiff_t>(size_));
  for (int k = 1; k < levels + 2; ++k) {
    reduce(cells_, 2 * k - 2, 2 * k, 1 << (k - 1), mergeCodes);
    if (k <= levels) reduce(cells_, 2 * k, 2 * k + 1, 1 << (k - 1), mergeCodes);
  }
  for (int k = 1; k < levels; ++k)
    reduce(free_, k - 1, k, 1 << (k - 1), [](std::uint8_t a, std::uint8_t b) { return std::max(a, b); });
}

void PlaceGrid::build(const std::vector<Reference>& references, double cell_m, int levels, double free_weight,
                      double max_range_m) {
  cell_m_ = cell_m;
  points_.clear();
  cells_.clear();
  std::vector<Reference> valid;
  for (const Reference& reference : references)
    if (reference.scan != nullptr && reference.map_from_scan.isFinite()) valid.push_back(reference);
  for (const Reference& reference : valid) findSurfaces(reference, max_range_m);
  if (points_.empty()) return;
  layOut(valid, 1 << (levels + 1));
  cells_.assign(size_ * static_cast<std::size_t>(2 * levels + 3), 0);
  stamped_.assign(size_, 0);
  free_.assign(size_ * static_cast<std::size_t>(levels), 0);
  makeKernels();
  for (const Point& point : points_) stamp(point);
  for (const Reference& reference : valid) markFree(reference, max_range_m);
  combine(free_weight);
  for (const Reference& reference : valid) markBody(reference);
  reduceAll(levels);
}

}  // namespace omnifleet::scan
