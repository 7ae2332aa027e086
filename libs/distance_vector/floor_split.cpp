#include "distance_vector/floor_split.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::distance_vector {
namespace {

constexpr int kLeastRows = 6;  // of each part
// Smoothed pixels are alike in neighbouring rows: the variance of their mean is that of so many times fewer.
constexpr float kIndependent = 0.375f;

float square(float x) {
  return x * x;
}

}  // namespace

FloorSplit::FloorSplit(const ColumnView& view, const WalkOptions& options) : view_(&view), options_(options) {
  sums_.resize(static_cast<std::size_t>(view.size().height) + 1);
}

FloorSplit::Chroma FloorSplit::chroma(const cv::Vec3f& colour, float level) const {
  // At the floor's level, so that the same surface in less light has the same chroma.
  const float scale = level / std::max(1.0f, colour.dot(direction_));
  return {scale * colour.dot(first_axis_), scale * colour.dot(second_axis_)};
}

void FloorSplit::begin(const FloorSample& floor, const std::optional<cv::Vec3f>& known) {
  is_known_ = known.has_value();
  direction_ = floor.direction;
  const cv::Vec3f blue(1.0f, 0.0f, 0.0f);
  first_axis_ = blue - direction_ * direction_[0];
  first_axis_ *= static_cast<float>(1.0 / std::max(1e-6, cv::norm(first_axis_)));
  second_axis_ = direction_.cross(first_axis_);
  level_ = floor.level;
  known_ = chroma(known.value_or(direction_), level_);
  least_ = static_cast<float>(options_.sigmas) * floor.across;
}

void FloorSplit::readColumn(const SmoothedImage& image, int u, int top) {
  const int bottom = image.size().height - 1;
  const float rows = static_cast<float>(bottom - top + 1), middle = 0.5f * (rows + 1.0f), half = 0.5f * rows;
  bottom_ = bottom;
  top_ = top;
  squares_ = 0.0f;
  moments_ = {};
  Chroma sum;
  for (int v = bottom, n = 1; v >= top; --v, ++n) {
    const Chroma c = chroma(image.colour(u, v), level_);
    sum.first += c.first;
    sum.second += c.second;
    squares_ += square(c.first) + square(c.second);
    sums_[static_cast<std::size_t>(n)] = sum;
    float power = 1.0f;
    for (Chroma& moment : moments_) {
      power *= (static_cast<float>(n) - middle) / half;
      moment.first += power * c.first;
      moment.second += power * c.second;
    }
  }
}

/// By how much a line or a cubic in the row lowers the sum of squares: discrete orthogonal polynomials of
/// degree 1 to 3 (Gram; Abramowitz and Stegun 22.17), rows scaled to ±1.
float FloorSplit::driftGain(float rows, const Chroma& all) const {
  const float n2 = rows * rows, h2 = 0.25f * n2;
  const float mean2 = (n2 - 1.0f) / 12.0f / h2, slope3 = (3.0f * n2 - 7.0f) / 20.0f / h2;
  const float norm1 = rows * mean2, norm2 = rows * (n2 - 1.0f) * (n2 - 4.0f) / 180.0f / (h2 * h2),
              norm3 = rows * (n2 - 1.0f) * (n2 - 4.0f) * (n2 - 9.0f) / 2800.0f / (h2 * h2 * h2);
  const auto gain = [&](float sum, float m1, float m2, float m3) {
    const float line = square(m1) / norm1;
    return is_known_ ? line : line + square(m2 - mean2 * sum) / norm2 + square(m3 - slope3 * m1) / norm3;
  };
  return gain(all.first, moments_[0].first, moments_[1].first, moments_[2].first) +
         gain(all.second, moments_[0].second, moments_[1].second, moments_[2].second);
}

/// Of the rows bottom … top, both included.
FloorSplit::Chroma FloorSplit::mean(int bottom, int top) const {
  const Chroma& below = sums_[static_cast<std::size_t>(bottom_ - bottom)];
  const Chroma& all = sums_[static_cast<std::size_t>(bottom_ - top + 1)];
  const auto n = static_cast<float>(bottom - top + 1);
  return {(all.first - below.first) / n, (all.second - below.second) / n};
}

bool FloorSplit::continues(int foot, int row) const {
  if (row < top_) return true;
  if (foot >= bottom_ || foot <= row) return false;
  const Chroma floor = mean(bottom_, foot + 1), object = mean(foot, row + 1), rest = mean(row, top_);
  return square(rest.first - object.first) + square(rest.second - object.second) <
         square(rest.first - floor.first) + square(rest.second - floor.second);
}

std::optional<int> FloorSplit::find(const SmoothedImage& image, int u) {
  const int bottom = image.size().height - 1, top = view_->checkRow(u);
  const int rows = bottom - top + 1;
  bottom_ = top_ = 0;
  if (rows < 2 * kLeastRows) return std::nullopt;
  readColumn(image, u, top);
  const Chroma all = sums_[static_cast<std::size_t>(rows)];
  const auto n = static_cast<float>(rows);
  const int last = std::min(rows - kLeastRows, bottom - view_->limitRow(u) + 1);
  float gain = 0.0f;
  int split = 0;
  for (int k = kLeastRows; k <= last; ++k) {
    const Chroma& below = sums_[static_cast<std::size_t>(k)];
    const auto m = static_cast<float>(k);
    const float g = (square(n * below.first - m * all.first) + square(n * below.second - m * all.second)) /
                    (n * m * (n - m));
    if (g <= gain) continue;
    gain = g;
    split = k;
  }
  if (split == 0) return std::nullopt;
  const float total = squares_ - (square(all.first) + square(all.second)) / n;
  const float drift = driftGain(n, all);
  const float variance = std::max(total - gain, 1e-6f) / (2.0f * (n - 2.0f));
  const auto sigmas = static_cast<float>(options_.sigmas);
  if ((gain - drift) * kIndependent < square(sigmas) * variance) return std::nullopt;
  const Chroma& sum = sums_[static_cast<std::size_t>(split)];
  const auto m = static_cast<float>(split);
  const Chroma below{sum.first / m, sum.second / m},
      above{(all.first - sum.first) / (n - m), (all.second - sum.second) / (n - m)};
  if (std::hypot(above.first - below.first, above.second - below.second) < least_) return std::nullopt;
  const float to_below = square(below.first - known_.first) + square(below.second - known_.second),
              to_above = square(above.first - known_.first) + square(above.second - known_.second);
  if (to_below >= to_above) return std::nullopt;
  return bottom - split;
}

}  // namespace omnifleet::distance_vector
