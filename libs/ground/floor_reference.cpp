#include "ground/floor_reference.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kLargeImage_px = 900;  // from this width on the model is made of blocks of 2×2 cells
constexpr int kSmoothingRounds =
    3;  // each takes most of the bias away that slopes and one-sided windows leave
constexpr float kFillWeight =
    0.02f;  // weight of the coarser level: only counts where the finer one knows little

/// out[i] = scale · Σ in[i + k · step], k < count.
OMNIFLEET_WIDE void sumAlong(const float* in, std::ptrdiff_t step, int count, float scale, int n,
                             float* out) {
  for (int i = 0; i < n; ++i) out[i] = in[i];
  for (int k = 1; k < count; ++k) {
    const float* next = in + k * step;
#pragma GCC ivdep
    for (int i = 0; i < n; ++i) out[i] += next[i];
  }
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) out[i] *= scale;
}

OMNIFLEET_WIDE void mix(const float* a, const float* b, float share, int n, float* out) {
  const float rest = 1.0f - share;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) out[i] = rest * a[i] + share * b[i];
}

/// Sums → means; `filler` (means) counts where the sums know little. Without anything: 0.
void divide(cv::Mat& sums, const cv::Mat* filler) {
  for (int y = 0; y < sums.rows; ++y) {
    auto* row = sums.ptr<cv::Vec4f>(y);
    const auto* fill = filler != nullptr ? filler->ptr<cv::Vec4f>(y) : nullptr;
    for (int x = 0; x < sums.cols; ++x) {
      if (fill != nullptr) row[x] += kFillWeight * fill[x];
      row[x] = row[x][3] > 1e-3f ? row[x] * (1.0f / row[x][3]) : cv::Vec4f(0, 0, 0, 0);
    }
  }
}

/// The least of each block × block cells, one value a whole block.
cv::Mat1b leastOf(const cv::Mat1b& cells, int block) {
  cv::Mat1b least(cells.rows / block, cells.cols / block, std::uint8_t{255});
  for (int y = 0; y < least.rows * block; ++y)
    for (int x = 0; x < least.cols * block; ++x)
      least(y / block, x / block) = std::min(least(y / block, x / block), cells(y, x));
  return least;
}

}  // namespace

ReferenceOptions ReferenceOptions::read(const options::Section& section) {
  ReferenceOptions o;
  section.read("tolerance_along", o.tolerance_along, {0.005, 0.9});
  section.read("tolerance_across", o.tolerance_across, {0.002, 0.9});
  section.read("noise_sigmas", o.noise_sigmas, {0.0, 20.0});
  section.read("min_share", o.min_share, {0.0, 0.5});
  section.read("smoothing_cells", o.smoothing_cells, {1, 40});
  section.finish();
  return o;
}

FloorReference::FloorReference(const FloorView& view, const ReferenceOptions& options)
    : options_(options),
      tolerance_{options.tolerance_along, options.tolerance_across, options.noise_sigmas},
      block_(view.imageSize().width >= kLargeImage_px ? 2 : 1),
      growth_(leastOf(view.coverage(), block_), leastOf(view.seeds(), block_), tolerance_, options.min_share),
      colour_(view.cells(), cv::Vec3f(0, 0, 0)) {
  const cv::Size blocks = growth_.means().size();
  sums_.create((blocks.height + 1) / 2, (blocks.width + 1) / 2, CV_32FC4);
  fine_.create(sums_.size(), CV_32FC4);
  pyramid_.resize(8);
  radius_ = std::max(1, options_.smoothing_cells / 2);
  framed_ = cv::Mat1f(sums_.rows + 2 * radius_, 4 * (sums_.cols + 2 * radius_), 0.0f);
  summed_.create(framed_.rows, 4 * sums_.cols);
}

bool FloorReference::learn(const cv::Mat3f& cell_means, double noise) {
  averageBlocks(cell_means);
  if (!growth_.grow(noise / (FloorView::kCell * block_))) return false;
  smooth();
  return true;
}

void FloorReference::averageBlocks(const cv::Mat3f& cell_means) {
  cv::Mat3f& means = growth_.means();
  if (block_ == 1) {
    cell_means.copyTo(means);
    return;
  }
  for (int y = 0; y < means.rows; ++y) {
    const auto *above = cell_means.ptr<float>(2 * y), *below = cell_means.ptr<float>(2 * y + 1);
    auto* out = means.ptr<float>(y);
    for (int i = 0; i < 3 * means.cols; i += 3, above += 6, below += 6)
      for (int c = 0; c < 3; ++c) out[i + c] = 0.25f * (above[c] + above[c + 3] + below[c] + below[c + 3]);
  }
}

void FloorReference::sumBlocks() {
  sums_.setTo(cv::Scalar::all(0));
  const cv::Mat3f& means = growth_.means();
  growth_.forGrown([&](int y, int x) {
    const cv::Vec3f& c = means(y, x);
    sums_.ptr<cv::Vec4f>(y / 2)[x / 2] += cv::Vec4f(c[0], c[1], c[2], 1.0f);
  });
}

void FloorReference::smooth() {
  // Normalised convolution of the grown cells, 2×2 of them at a time; then the same of what it left over.
  sumBlocks();
  fine_.setTo(cv::Scalar::all(0));
  residual_.create(sums_.size(), CV_32FC4);
  for (int round = 0; round < kSmoothingRounds; ++round) {
    for (int y = 0; y < sums_.rows; ++y) {
      const auto *sum = sums_.ptr<cv::Vec4f>(y), *have = fine_.ptr<cv::Vec4f>(y);
      auto* rest = framed_.ptr<cv::Vec4f>(y + radius_) + radius_;
      for (int x = 0; x < sums_.cols; ++x) {
        const float weight = sum[x][3];
        rest[x] = cv::Vec4f(sum[x][0] - have[x][0] * weight, sum[x][1] - have[x][1] * weight,
                            sum[x][2] - have[x][2] * weight, weight);
      }
    }
    blurTwice();
    if (round == 0)
      fillAndDivide(residual_);
    else
      divide(residual_, nullptr);
    fine_ += residual_;
  }
  spread();
}

/// framed_ → residual_, each time the mean over a square of side 2·radius_ + 1, zeros beyond the edge.
void FloorReference::blurTwice() {
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

FloorReference::Between FloorReference::between(int fine, int scale, int coarse_size) {
  const float at = (static_cast<float>(fine) + 0.5f) / static_cast<float>(scale) - 0.5f;
  const int first = std::clamp(static_cast<int>(std::floor(at)), 0, coarse_size - 1);
  return {first, std::min(first + 1, coarse_size - 1),
          std::clamp(at - static_cast<float>(first), 0.0f, 1.0f)};
}

/// fine_ → colour_, bilinearly.
void FloorReference::spread() {
  const int scale = 2 * block_;
  wide_.create(fine_.rows, colour_.cols);
  if (columns_.empty())
    for (int x = 0; x < colour_.cols; ++x) columns_.push_back(between(x, scale, fine_.cols));
  for (int y = 0; y < fine_.rows; ++y) {
    const auto* row = fine_.ptr<cv::Vec4f>(y);
    auto* to = wide_.ptr<cv::Vec3f>(y);
    for (int x = 0; x < colour_.cols; ++x) {
      const Between& at = columns_[static_cast<std::size_t>(x)];
      const cv::Vec4f &a = row[at.first], &b = row[at.second];
      for (int c = 0; c < 3; ++c) to[x][c] = (1.0f - at.share) * a[c] + at.share * b[c];
    }
  }
  for (int y = 0; y < colour_.rows; ++y) {
    const Between rows = between(y, scale, fine_.rows);
    mix(wide_.ptr<float>(rows.first), wide_.ptr<float>(rows.second), rows.share, 3 * colour_.cols,
        colour_.ptr<float>(y));
  }
}

void FloorReference::fillAndDivide(cv::Mat& sums) {
  // Where the window holds hardly any floor, a coarser one fills in, level by level.
  for (std::size_t k = 0; k < pyramid_.size(); ++k) {
    const cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(finer, pyramid_[k], {(finer.cols + 1) / 2, (finer.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
  }
  divide(pyramid_.back(), nullptr);
  for (std::size_t k = pyramid_.size(); k-- > 0;) {
    cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(pyramid_[k], filler_, finer.size(), 0, 0, cv::INTER_LINEAR);
    divide(finer, &filler_);
  }
}

}  // namespace omnifleet::ground
