#include "ground/floor_smoothing.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

constexpr int kRounds = 3;  // each takes most of the bias away that slopes and one-sided windows leave
constexpr float kFillWeight =
    0.02f;                       // weight of the coarser level: only counts where the finer one knows little
constexpr int kUsualWindow = 5;  // pixels
constexpr int kMargin = 3;       // cells around the view that its pixels' neighbours may lie in

using lanes::FourFloats;  // colour and weight

/// Of n pixels' sums what the means found so far do not explain.
OMNIFLEET_WIDE void takeRest(const float* sums, const float* have, int n, float* rest) {
  for (int i = 0; i < 4 * n; i += 4) {
    const auto sum = lanes::load<FourFloats>(sums + i);
    FourFloats mean = lanes::load<FourFloats>(have + i);
    mean[3] = 0.0f;  // the weight stays
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

/// Sums of n pixels → means; `filler` (means, or null) counts where the sums know little. Without anything:
/// 0.
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

FloorSmoothing::FloorSmoothing(const FloorGrowth& growth, const FloorView& view, int per_block,
                               int window_cells)
    : scale_(2 * per_block),
      radius_(std::max(1, window_cells / 2)),
      sum_of_(static_cast<std::size_t>(growth.numbers()), 0),
      sums_((growth.means().rows + 1) / 2, (growth.means().cols + 1) / 2),
      fine_(sums_.size()),
      residual_(sums_.size()),
      framed_(sums_.rows + 2 * radius_, 4 * (sums_.cols + 2 * radius_), 0.0f),
      summed_(framed_.rows, 4 * sums_.cols),
      pyramid_(8),
      asked_(view.rowsWithin(kMargin)),
      asked_wide_(static_cast<std::size_t>(sums_.rows)),
      wide_(sums_.rows, view.cells().width),
      colour_(view.cells(), cv::Vec3f(0, 0, 0)) {
  for (int y = 0; y < growth.means().rows; ++y)
    for (int x = 0; x < growth.means().cols; ++x)
      sum_of_[static_cast<std::size_t>(growth.numberOf(y, x))] = y / 2 * sums_.cols + x / 2;
  const cv::Size cells = view.cells();
  for (int x = 0; x < cells.width; ++x) columns_.push_back(between(x, scale_, fine_.cols));
  for (int y = 0; y < cells.height; ++y) {
    rows_.push_back(between(y, scale_, fine_.rows));
    for (const int row : {rows_.back().first, rows_.back().second}) {
      cv::Range& wide = asked_wide_[static_cast<std::size_t>(row)];
      const cv::Range& here = asked_[static_cast<std::size_t>(y)];
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

const cv::Mat3f& FloorSmoothing::smooth(const FloorGrowth& growth) {
  sumBlocks(growth);
  fine_.setTo(0);
  for (int round = 0; round < kRounds; ++round) {
    for (int y = 0; y < sums_.rows; ++y)
      takeRest(sums_.ptr<float>(y), fine_.ptr<float>(y), sums_.cols,
               framed_.ptr<float>(y + radius_) + 4 * radius_);
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

void FloorSmoothing::shine(const cv::Mat1f& light) {
  for (int y = 0; y < colour_.rows; ++y) {
    const cv::Range& columns = asked_[static_cast<std::size_t>(y)];
    for (int x = columns.start; x < columns.end; ++x) colour_(y, x) *= light(y, x);
  }
}

void FloorSmoothing::sumBlocks(const FloorGrowth& growth) {
  sums_.setTo(0);
  const float* means = growth.meansByNumber();
  const std::vector<int>& grown = growth.grown();
  for (std::size_t k = 0; k < grown.size(); ++k) {
    constexpr std::size_t kAhead = 8;  // blocks, as growth goes through memory in rings
    const int block = grown[k], next = grown[std::min(k + kAhead, grown.size() - 1)];
    __builtin_prefetch(&sum_of_[static_cast<std::size_t>(next)]);
    __builtin_prefetch(means + 3 * next);
    auto mean = lanes::load<FourFloats>(means + 3 * block);
    mean[3] = 1.0f;
    float* sum = sums_.ptr<float>() + 4 * sum_of_[static_cast<std::size_t>(block)];
    lanes::store(lanes::load<FourFloats>(sum) + mean, sum);
  }
}

/// framed_ → residual_, each time the mean over a square of side 2·radius_ + 1, zeros beyond the edge.
void FloorSmoothing::blurTwice() {
  const int side = 2 * radius_ + 1, n = 4 * sums_.cols;
  const float scale = 1.0f / static_cast<float>(side * side);
  for (int pass = 0; pass < 2; ++pass) {
    for (int y = 0; y < framed_.rows; ++y)
      sumAlong(framed_.ptr<float>(y), 4, side, 1.0f, n, summed_.ptr<float>(y));
    for (int y = 0; y < sums_.rows; ++y) {
      float* to = pass == 0 ? framed_.ptr<float>(y + radius_) + 4 * radius_ : residual_.ptr<float>(y);
      sumAlong(summed_.ptr<float>(y), static_cast<std::ptrdiff_t>(summed_.step1()), side, scale, n, to);
    }
  }
}

/// Where the window holds hardly any floor, a coarser one fills in, level by level.
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

/// fine_ → colour_, bilinearly.
void FloorSmoothing::spread() {
  for (int y = 0; y < fine_.rows; ++y) {
    const cv::Range& columns = asked_wide_[static_cast<std::size_t>(y)];
    if (!columns.empty())
      mixColumns(fine_.ptr<float>(y), columns_.data() + columns.start, columns.size(),
                 wide_.ptr<float>(y) + 3 * columns.start);
  }
  for (int y = 0; y < colour_.rows; ++y) {
    const Between& at = rows_[static_cast<std::size_t>(y)];
    const cv::Range& columns = asked_[static_cast<std::size_t>(y)];
    const int first = 3 * columns.start;
    mix(wide_.ptr<float>(at.first) + first, wide_.ptr<float>(at.second) + first, at.share, 3 * columns.size(),
        colour_.ptr<float>(y) + first);
  }
}

/// n > 0 colours between those of a row with weights.
OMNIFLEET_WIDE void FloorSmoothing::mixColumns(const float* row, const Between* between, int n, float* out) {
  const auto at = [=](int x) __attribute__((always_inline)) {
    const Between& b = between[x];
    return (1.0f - b.share) * lanes::load<FourFloats>(row + 4 * b.first) +
           b.share * lanes::load<FourFloats>(row + 4 * b.second);
  };
  // A colour is stored with a number too many, which the next one overwrites.
  for (int x = 0; x < n - 1; ++x) lanes::store(at(x), out + 3 * x);
  const FourFloats last = at(n - 1);
  for (int c = 0; c < 3; ++c) out[3 * (n - 1) + c] = last[c];
}

}  // namespace omnifleet::ground
