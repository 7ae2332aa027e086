#include "ground/cell_means.h"

#include <algorithm>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr float kShare = 1.0f / (kCell * kCell);
constexpr int kLine = 64;  // bytes of a cache line
constexpr int kSpare = 8;  // numbers behind the columns that vectors may read

/// Sums of four rows of n bytes.
OMNIFLEET_WIDE void sumColumns(const std::uint8_t* top, std::ptrdiff_t row_step, int n, std::uint16_t* sums) {
  static_assert(kCell == 4);
  const std::uint8_t *a = top, *b = a + row_step, *c = b + row_step, *d = c + row_step;
  // Image rows are far apart in memory. The rows of the next cells are prefetched while these are summed.
  for (int i = 0; i < n; i += kLine) {
    for (int k = 4; k < 8; ++k) __builtin_prefetch(top + k * row_step + i, 0, 3);
    const int end = std::min(n, i + kLine);
#pragma GCC ivdep
    for (int j = i; j < end; ++j) sums[j] = static_cast<std::uint16_t>(a[j] + b[j] + c[j] + d[j]);
  }
}

/// Three channels and the first value behind them, times kShare.
OMNIFLEET_INLINE lanes::FourFloats meanOfColumns(const std::uint16_t* columns) {
  const auto pixel = [columns](int k) { return lanes::load<lanes::FourShorts>(columns + 3 * k); };
  return kShare * lanes::floats((pixel(0) + pixel(1)) + (pixel(2) + pixel(3)));
}

OMNIFLEET_WIDE void takeColourMeans(const std::uint16_t* columns, int cells, float* means) {
  // Each store writes one value too many, which the next store overwrites.
  for (int x = 0; x < cells - 1; ++x) lanes::store(meanOfColumns(columns + 3 * kCell * x), means + 3 * x);
  if (cells < 1) return;
  const lanes::FourFloats last = meanOfColumns(columns + 3 * kCell * (cells - 1));
  for (int c = 0; c < 3; ++c) means[3 * (cells - 1) + c] = last[c];
}

void takeGreyMeans(const std::uint16_t* columns, int cells, float* means) {
  for (int x = 0; x < cells; ++x, columns += kCell) {
    const int sum = columns[0] + columns[1] + columns[2] + columns[3];
    std::fill_n(means + 3 * x, 3, kShare * static_cast<float>(sum));
  }
}

}  // namespace

CellMeans::CellMeans(const FloorView& view)
    : view_(&view),
      means_(view.cells(), cv::Vec3f(0, 0, 0)),
      columns_(static_cast<std::size_t>(3 * view.imageSize().width + kSpare)) {}

void CellMeans::read(const cv::Mat& image) {
  for (int y = 0; y < means_.rows; ++y) average(image, y);
}

void CellMeans::average(const cv::Mat& image, int cell_row) {
  const cv::Range cells = view_->rows()[static_cast<std::size_t>(cell_row)];
  if (cells.empty()) return;
  const int channels = image.channels(), first = cells.start * kCell * channels;
  sumColumns(image.ptr(cell_row * kCell) + first, static_cast<std::ptrdiff_t>(image.step[0]),
             cells.size() * kCell * channels, columns_.data());
  auto* means = means_.ptr<float>(cell_row) + 3 * cells.start;
  if (channels == 3)
    takeColourMeans(columns_.data(), cells.size(), means);
  else
    takeGreyMeans(columns_.data(), cells.size(), means);
}

}  // namespace omnifleet::ground
