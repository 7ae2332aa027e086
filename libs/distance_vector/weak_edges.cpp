#include "distance_vector/weak_edges.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::distance_vector {
namespace {

constexpr int kRounds = 4;
constexpr float kLeastShare = 0.5f;    // of the columns of a window
constexpr float kToScatter = 1.4826f;  // median of absolute deviations → σ
constexpr float kLeastScatter_px = 0.1f;
constexpr float kMostSimilar = 0.9f;  // correlation of neighbours

}  // namespace

/// How many times the variance of a mean of these edges exceeds that of independent ones: texture shifts
/// neighbouring edges alike (residuals as a first-order autoregressive process).
float WeakEdges::correlation(const std::vector<ColumnEnd>& ends, const std::vector<EdgeFusion::Edge>& edges,
                             int u, int first, int end, float level, float slope, float limit) {
  float before = std::numeric_limits<float>::quiet_NaN(), products = 0.0f, squares = 0.0f;
  for (int k = first; k < end; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const float r = ends[i].weak ? edges[i].row - level - slope * static_cast<float>(k - u)
                                 : std::numeric_limits<float>::quiet_NaN();
    if (!(std::abs(r) < limit)) {
      before = std::numeric_limits<float>::quiet_NaN();
      continue;
    }
    if (!std::isnan(before)) {
      products += r * before;
      squares += 0.5f * (r * r + before * before);
    }
    before = r;
  }
  const float similar = squares > 0.0f ? std::clamp(products / squares, 0.0f, kMostSimilar) : kMostSimilar;
  return (1.0f + similar) / (1.0f - similar);
}

WeakEdges::Line WeakEdges::fit(const std::vector<ColumnEnd>& ends, const std::vector<EdgeFusion::Edge>& edges,
                               int u, int first, int end) {
  Line line;
  const auto usable = [&](int k) {
    const auto i = static_cast<std::size_t>(k);
    return ends[i].weak && !std::isnan(edges[i].row);
  };
  float scatter = std::numeric_limits<float>::infinity(), level = 0.0f, slope = 0.0f;
  for (int round = 0; round < kRounds; ++round) {
    float n = 0, sw = 0, sx = 0, sxx = 0, sy = 0, sxy = 0, sww = 0;
    for (int k = first; k < end; ++k) {
      if (!usable(k)) continue;
      const auto x = static_cast<float>(k - u), y = edges[static_cast<std::size_t>(k)].row;
      float w = 1.0f;
      if (std::isfinite(scatter)) {
        const float r = (y - level - slope * x) / (outlier_sigmas_ * scatter);
        w = std::abs(r) < 1.0f ? (1.0f - r * r) * (1.0f - r * r) : 0.0f;  // Tukey's biweight
      }
      n += 1.0f;
      sw += w;
      sww += w * w;
      sx += w * x;
      sxx += w * x * x;
      sy += w * y;
      sxy += w * x * y;
    }
    if (n < kLeastShare * static_cast<float>(window_px_) || sw < 0.5f * n) return {};
    const float xx = sxx - sx * sx / sw;
    if (xx <= 0.0f) return {};
    slope = (sxy - sx * sy / sw) / xx;
    level = (sy - slope * sx) / sw;
    residuals_.clear();
    for (int k = first; k < end; ++k)
      if (usable(k))
        residuals_.push_back(
            std::abs(edges[static_cast<std::size_t>(k)].row - level - slope * static_cast<float>(k - u)));
    const auto middle = residuals_.begin() + static_cast<std::ptrdiff_t>(residuals_.size() / 2);
    std::nth_element(residuals_.begin(), middle, residuals_.end());
    scatter = std::max(kLeastScatter_px, kToScatter * *middle);
    line = {true, level, scatter * scatter * (1.0f / sw + sx * sx / (sw * sw) / xx), scatter};
  }
  line.variance *= correlation(ends, edges, u, first, end, level, slope, outlier_sigmas_ * scatter);
  return line;
}

const std::vector<EdgeFusion::Edge>& WeakEdges::smooth(const std::vector<ColumnEnd>& ends,
                                                       const std::vector<EdgeFusion::Edge>& edges) {
  smoothed_ = edges;
  const int columns = static_cast<int>(ends.size()), half = window_px_ / 2;
  for (int u = 0; u < columns; ++u) {
    const auto i = static_cast<std::size_t>(u);
    if (!ends[i].weak) continue;
    Line best;
    for (const int first : {u - half, u - window_px_ + 1, u}) {
      const Line line = fit(ends, edges, u, std::max(0, first), std::min(columns, first + window_px_));
      if (line.is_found && (!best.is_found || line.scatter < best.scatter)) best = line;
    }
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    smoothed_[i] = best.is_found && best.scatter < jump_px_
                       ? EdgeFusion::Edge{best.row, std::sqrt(best.variance + shared_px_ * shared_px_)}
                       : EdgeFusion::Edge{kNone, kNone};
  }
  return smoothed_;
}

}  // namespace omnifleet::distance_vector
