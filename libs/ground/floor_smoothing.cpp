#include "ground/floor_smoothing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

constexpr int kRounds = 3;  // each round removes most of the bias of gradients and one-sided windows
constexpr float kFillWeight =
    0.02f;  // weight of the coarser level; it matters only where the finer one holds little floor
constexpr int kUsualWindow = 5;  // pixels
constexpr int kMargin = 3;       // cells around the view that pixels may refer to

using lanes::FourFloats;  // colour and weight

/// Residual of n pixels' sums after subtraction of the means found so far.
OMNIFLEET_WIDE void takeRest(const float* sums, const float* have, int n, float* rest) {
  for (int i = 0; i < 4 * n; i += 4) {
    const auto sum = lanes::load<FourFloats>(sums + i);
    FourFloats mean = lanes::load<FourFloats>(have + i);
    mean[3] = 0.0f;  // the weight stays unchanged
    lanes::store(sum - mean * sum[3], rest + i);
  }
}

/// out[i] = scale · Σ in[i + k · step], k < count.
template <int kCount>
OMNIFLEET_INLINE void sumWindow(const float* in, std::ptrdiff_t step, int count, float scale, int n,
                                float* out) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    float sum = in[i];
    for (int k = 1; k < (kCount > 0 ? kCount : count); ++k) sum += in[i + k * step];
    out[i] = sum * scale;
  }
}

OMNIFLEET_WIDE void sumAlong(const float* in, std::ptrdiff_t step, int count, float scale, int n,
                             float* out) {
  if (count == kUsualWindow)
    sumWindow<kUsualWindow>(in, step, count, scale, n, out);
  else
    sumWindow<0>(in, step, count, scale, n, out);
}

OMNIFLEET_WIDE void mix(const float* a, const float* b, float share, int n, float* out) {
  const float rest = 1.0f - share;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) out[i] = rest * a[i] + share * b[i];
}

/// Divides the sums of n pixels by their weights. `filler` (means, or null) contributes where the weight is
/// low. Without any weight the result is 0.
OMNIFLEET_WIDE void divide(const float* filler, int n, float* sums) {
  for (int i = 0; i < 4 * n; i += 4) {
    auto sum = lanes::load<FourFloats>(sums + i);
    if (filler != nullptr) sum += kFillWeight * lanes::load<FourFloats>(filler + i);
    lanes::store(sum[3] > 1e-3f ? sum * (1.0f / sum[3]) : FourFloats{}, sums + i);
  }
}

void divide(const cv::Mat* filler, cv::Mat& sums) {
  for (int y = 0; y < sums.rows; ++y)
    divide(filler != nullptr ? filler->ptr<float>(y) : nullptr, sums.cols, sums.ptr<float>(y));
}

}  // namespace

FloorSmoothing::FloorSmoothing(const RegionGrowing& growing, const FloorView& view, int per_block,
                               int window_cells)
    : scale_(2 * per_block),
      radius_(std::max(1, window_cells / 2)),
      sum_of_(static_cast<std::size_t>(growing.numbers()), 0),
      sums_((growing.means().rows + 1) / 2, (growing.means().cols + 1) / 2),
      fine_(sums_.size()),
      residual_(sums_.size()),
      padded_(sums_.rows + 2 * radius_, 4 * (sums_.cols + 2 * radius_), 0.0f),
      summed_(padded_.rows, 4 * sums_.cols),
      pyramid_(8),
      used_columns_(view.rowsWithin(kMargin)),
      used_wide_columns_(static_cast<std::size_t>(sums_.rows)),
      wide_(sums_.rows, view.cells().width),
      colour_(view.cells(), cv::Vec3f(0, 0, 0)) {
  for (int y = 0; y < growing.means().rows; ++y)
    for (int x = 0; x < growing.means().cols; ++x)
      sum_of_[static_cast<std::size_t>(growing.numberOf(y, x))] = y / 2 * sums_.cols + x / 2;
  const cv::Size cells = view.cells();
  for (int x = 0; x < cells.width; ++x) columns_.push_back(between(x, scale_, fine_.cols));
  for (int y = 0; y < cells.height; ++y) {
    rows_.push_back(between(y, scale_, fine_.rows));
    for (const int row : {rows_.back().first, rows_.back().second}) {
      cv::Range& wide = used_wide_columns_[static_cast<std::size_t>(row)];
      const cv::Range& here = used_columns_[static_cast<std::size_t>(y)];
      if (here.empty()) continue;
      wide = wide.empty() ? here : cv::Range(std::min(wide.start, here.start), std::max(wide.end, here.end));
    }
  }
}

FloorSmoothing::Between FloorSmoothing::between(int cell, int scale, int coarse_size) {
  const float at = (static_cast<float>(cell) + 0.5f) / static_cast<float>(scale) - 0.5f;
  const int first = std::clamp(static_cast<int>(std::floor(at)), 0, coarse_size - 1);
  return {first, std::min(first + 1, coarse_size - 1),
          std::clamp(at - static_cast<float>(first), 0.0f, 1.0f)};
}

const cv::Mat3f& FloorSmoothing::smooth(const RegionGrowing& growing) {
  sumBlocks(growing);
  fine_.setTo(0);
  for (int round = 0; round < kRounds; ++round) {
    for (int y = 0; y < sums_.rows; ++y)
      takeRest(sums_.ptr<float>(y), fine_.ptr<float>(y), sums_.cols,
               padded_.ptr<float>(y + radius_) + 4 * radius_);
    blurTwice();
    if (round == 0)
      fillAndDivide();
    else
      divide(nullptr, residual_);
    fine_ += residual_;
  }
  spread();
  return colour_;
}

void FloorSmoothing::applyLight(const cv::Mat1f& light) {
  for (int y = 0; y < colour_.rows; ++y) {
    const cv::Range& columns = used_columns_[static_cast<std::size_t>(y)];
    for (int x = columns.start; x < columns.end; ++x) colour_(y, x) *= light(y, x);
  }
}

void FloorSmoothing::sumBlocks(const RegionGrowing& growing) {
  sums_.setTo(0);
  const float* means = growing.meansByNumber();
  const std::vector<int>& grown = growing.grown();
  for (std::size_t k = 0; k < grown.size(); ++k) {
    constexpr std::size_t kAhead = 8;  // blocks to prefetch ahead, as region growing visits memory in rings
    const int block = grown[k], next = grown[std::min(k + kAhead, grown.size() - 1)];
    __builtin_prefetch(&sum_of_[static_cast<std::size_t>(next)]);
    __builtin_prefetch(means + 3 * next);
    auto mean = lanes::load<FourFloats>(means + 3 * block);
    mean[3] = 1.0f;
    float* sum = sums_.ptr<float>() + 4 * sum_of_[static_cast<std::size_t>(block)];
    lanes::store(lanes::load<FourFloats>(sum) + mean, sum);
  }
}

/// Two box filters of side 2·radius_ + 1 from padded_ to residual_, with zeros outside the border.
void FloorSmoothing::blurTwice() {
  const int side = 2 * radius_ + 1, n = 4 * sums_.cols;
  const float scale = 1.0f / static_cast<float>(side * side);
  for (int pass = 0; pass < 2; ++pass) {
    for (int y = 0; y < padded_.rows; ++y)
      sumAlong(padded_.ptr<float>(y), 4, side, 1.0f, n, summed_.ptr<float>(y));
    for (int y = 0; y < sums_.rows; ++y) {
      float* to = pass == 0 ? padded_.ptr<float>(y + radius_) + 4 * radius_ : residual_.ptr<float>(y);
      sumAlong(summed_.ptr<float>(y), static_cast<std::ptrdiff_t>(summed_.step1()), side, scale, n, to);
    }
  }
}

/// Fills windows with hardly any floor from a coarser level, level by level.
void FloorSmoothing::fillAndDivide() {
  for (std::size_t k = 0; k < pyramid_.size(); ++k) {
    const cv::Mat& finer = k == 0 ? residual_ : pyramid_[k - 1];
    cv::resize(finer, pyramid_[k], {(finer.cols + 1) / 2, (finer.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
  }
  divide(nullptr, pyramid_.back());
  for (std::size_t k = pyramid_.size(); k-- > 0;) {
    cv::Mat& finer = k == 0 ? residual_ : pyramid_[k - 1];
    cv::resize(pyramid_[k], filler_, finer.size(), 0, 0, cv::INTER_LINEAR);
    divide(&filler_, finer);
  }
}

/// Interpolates fine_ bilinearly to colour_.
void FloorSmoothing::spread() {
  for (int y = 0; y < fine_.rows; ++y) {
    const cv::Range& columns = used_wide_columns_[static_cast<std::size_t>(y)];
    if (!columns.empty())
      mixColumns(fine_.ptr<float>(y), columns_.data() + columns.start, columns.size(),
                 wide_.ptr<float>(y) + 3 * columns.start);
  }
  for (int y = 0; y < colour_.rows; ++y) {
    const Between& at = rows_[static_cast<std::size_t>(y)];
    const cv::Range& columns = used_columns_[static_cast<std::size_t>(y)];
    const int first = 3 * columns.start;
    mix(wide_.ptr<float>(at.first) + first, wide_.ptr<float>(at.second) + first, at.share, 3 * columns.size(),
        colour_.ptr<float>(y) + first);
  }
}

/// Interpolates n > 0 colours in a row of colours with weights.
OMNIFLEET_WIDE void FloorSmoothing::mixColumns(const float* row, const Between* between, int n, float* out) {
  const auto at = [=](int x) __attribute__((always_inline)) {
    const Between& b = between[x];
    return (1.0f - b.share) * lanes::load<FourFloats>(row + 4 * b.first) +
           b.share * lanes::load<FourFloats>(row + 4 * b.second);
  };
  // Each store writes one value too many, which the next store overwrites.
  for (int x = 0; x < n - 1; ++x) lanes::store(at(x), out + 3 * x);
  const FourFloats last = at(n - 1);
  for (int c = 0; c < 3; ++c) out[3 * (n - 1) + c] = last[c];
}

}  // namespace omnifleet::ground
