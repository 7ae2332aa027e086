#include "distance_vector/edge_fusion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::distance_vector {
namespace {

constexpr std::size_t kLeastOffsets = 24;  // columns that say how far shadows shift edges
constexpr float kToSigma = 1.4826f;        // median of absolute deviations → σ
constexpr float kSharedColumns = 16.0f;    // JPEG codes hue in blocks of sixteen columns
constexpr float kSingle_px = 3.0f;         // offsets beyond belong to different edges
constexpr float kSameLine_px = 6.0f;       // steps within a window beyond belong to another boundary
constexpr int kLeastOnLine = 6;            // columns that show how much edges scatter

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

float square(float x) {
  return x * x;
}

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// σ of one kind of edge about a straight line, over the columns around whose edges are near; infinite where
/// too few are.
float scatterAround(const std::vector<ColumnEdges::Pair>& pairs, std::size_t u, int window_px,
                    std::optional<ColumnEdges::Edge> ColumnEdges::Pair::*kind) {
  const float here = (pairs[u].*kind)->row;
  const auto middle = static_cast<int>(u);
  const int from = std::max(0, middle - window_px),
            to = std::min(static_cast<int>(pairs.size()) - 1, middle + window_px);
  float n = 0.0f, sx = 0.0f, sy = 0.0f, sxx = 0.0f, sxy = 0.0f, syy = 0.0f;
  for (int i = from; i <= to; ++i) {
    const auto& edge = pairs[static_cast<std::size_t>(i)].*kind;
    if (!edge || std::abs(edge->row - here) > kSameLine_px) continue;
    const auto x = static_cast<float>(i - middle);
    const float y = edge->row - here;
    n += 1.0f;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
    syy += y * y;
  }
  if (n < static_cast<float>(kLeastOnLine)) return std::numeric_limits<float>::infinity();
  const float slope = (sxy - sx * sy / n) / (sxx - sx * sx / n);
  const float squares = syy - sy * sy / n - slope * (sxy - sx * sy / n);
  return std::sqrt(std::max(squares, 0.0f) / (n - 2.0f));
}

}  // namespace

/// The edge in hue, if it scatters less than that in luma, which then lies on texture: a wall as bright as
/// the floor has its edge in hue alone. Edges of weak columns are noisy in hue.
std::optional<EdgeFusion::Edge> EdgeFusion::smootherHue(const std::vector<Pair>& pairs, std::size_t u) const {
  const Pair& here = pairs[u];
  if (here.weak || !here.luma || !here.hue) return std::nullopt;
  const float hue_px = scatterAround(pairs, u, window_px_, &Pair::hue);
  if (!(std::hypot(hue_px, shared_px_) < scatterAround(pairs, u, window_px_, &Pair::luma)))
    return std::nullopt;
  return Edge{here.hue->row, std::hypot(std::max(here.hue->sigma_px, hue_px), shared_px_)};
}

/// The mean offset of the boundary around a column, and its variance.
EdgeFusion::Offset EdgeFusion::offsetAround(const std::vector<Pair>& pairs, std::size_t u) const {
  if (!pairs[u].luma) return {};
  float weight = 0.0f, sum = 0.0f, columns = 0.0f;
  const auto add = [&](const Pair& pair) {
    if (!pair.hue) return;
    const float offset = pair.luma->row - pair.hue->row;
    if (std::abs(offset) > kSingle_px) return;
    const float w = 1.0f / (square(pair.luma->sigma_px) + square(pair.hue->sigma_px));
    weight += w;
    sum += w * offset;
    columns += 1.0f;
  };
  add(pairs[u]);
  for (const int step : {-1, 1}) {
    float row = pairs[u].luma->row;
    for (int k = 1; k <= window_px_; ++k) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(u) + step * k;
      if (at < 0 || at >= static_cast<std::ptrdiff_t>(pairs.size())) break;
      const Pair& pair = pairs[static_cast<std::size_t>(at)];
      if (!pair.luma || std::abs(pair.luma->row - row) > jump_px_) break;
      row = pair.luma->row;
      add(pair);
    }
  }
  if (!(weight > 0.0f)) return {};
  return {true, sum / weight, std::min(columns, kSharedColumns) / weight + square(shared_px_)};
}

/// The offsets of all boundaries of the image say how far shadows shift edges in this scene.
void EdgeFusion::measureScene(const std::vector<Pair>& pairs) {
  offsets_.resize(pairs.size());
  means_.clear();
  float noise = 0.0f;
  for (std::size_t u = 0; u < pairs.size(); ++u) {
    const Offset& offset = offsets_[u] = offsetAround(pairs, u);
    if (!offset.is_known) continue;
    means_.push_back(offset.mean_px);
    noise += offset.variance;
  }
  if (means_.size() < kLeastOffsets) return;  // the scene is as before
  noise /= static_cast<float>(means_.size());
  shift_ = medianOf(means_);
  for (float& mean : means_) mean = std::abs(mean - shift_);
  scatter_ = std::sqrt(std::max(square(kToSigma * medianOf(means_)) - noise, 0.0f));
}

EdgeFusion::Edge EdgeFusion::fuseColumn(const Pair& here, const Offset& offset) const {
  if (!here.luma && !here.hue) return {kNone, kNone};
  // Far apart, they are two edges: that of a shadow, and behind it that of the object.
  const bool two_edges = here.luma && here.hue && here.luma->row - here.hue->row > kSingle_px;
  if (!here.luma || two_edges) return {here.hue->row, std::hypot(here.hue->sigma_px, shared_px_)};
  const float luma_variance = square(here.luma->sigma_px), prior = square(scatter_) + 0.25f * square(shift_);
  if (!offset.is_known) return {here.luma->row - shift_, std::sqrt(luma_variance + prior)};
  const float gain = prior > 0.0f ? prior / (prior + offset.variance) : 0.0f;
  return {here.luma->row - shift_ - gain * (offset.mean_px - shift_),
          std::sqrt(luma_variance + gain * offset.variance)};
}

const std::vector<EdgeFusion::Edge>& EdgeFusion::fuse(const std::vector<Pair>& pairs) {
  means_.reserve(pairs.size());
  measureScene(pairs);
  edges_.resize(pairs.size());
  for (std::size_t u = 0; u < pairs.size(); ++u) {
    const auto hue = smootherHue(pairs, u);
    edges_[u] = hue ? *hue : fuseColumn(pairs[u], offsets_[u]);
  }
  return edges_;
}

}  // namespace omnifleet::distance_vector
