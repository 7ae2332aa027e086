#include "distance_vector/edge_fusion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::distance_vector {
namespace {

constexpr std::size_t kLeastOffsets = 24;  // columns that say how far shadows shift edges
constexpr float kToSigma = 1.4826f;        // median of absolute deviations → σ
constexpr float kSharedColumns = 8.0f;     // hue is one value per two columns, coded in blocks of sixteen
constexpr float kSingle_px = 3.0f;         // offsets beyond belong to different edges

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

float square(float x) {
  return x * x;
}

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void EdgeFusion::measureScene(const std::vector<Pair>& pairs) {
  offsets_.clear();
  float noise = 0.0f;
  for (const Pair& pair : pairs) {
    if (!pair.luma || !pair.hue) continue;
    const float offset = pair.luma->row - pair.hue->row;
    if (std::abs(offset) > kSingle_px) continue;
    offsets_.push_back(offset);
    noise += square(pair.luma->sigma_px) + square(pair.hue->sigma_px);
  }
  if (offsets_.size() < kLeastOffsets) return;  // the scene is as before
  noise /= static_cast<float>(offsets_.size());
  shift_ = medianOf(offsets_);
  for (float& offset : offsets_) offset = std::abs(offset - shift_);
  const float total = kToSigma * medianOf(offsets_);
  scatter_ = std::sqrt(std::max(square(total) - noise, 0.0f));
}

EdgeFusion::Edge EdgeFusion::fuseColumn(const std::vector<Pair>& pairs, std::size_t u) const {
  const Pair& here = pairs[u];
  if (!here.luma && !here.hue) return {kNone, kNone};
  // Far apart, they are two edges: that of a shadow, and behind it that of the object.
  const bool two_edges = here.luma && here.hue && here.luma->row - here.hue->row > kSingle_px;
  if (!here.luma || two_edges) return {here.hue->row, here.hue->sigma_px};
  const float luma_variance = square(here.luma->sigma_px);
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
  add(here);
  for (const int step : {-1, 1}) {
    float row = here.luma->row;
    for (int k = 1; k <= window_px_; ++k) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(u) + step * k;
      if (at < 0 || at >= static_cast<std::ptrdiff_t>(pairs.size())) break;
      const Pair& pair = pairs[static_cast<std::size_t>(at)];
      if (!pair.luma || std::abs(pair.luma->row - row) > jump_px_) break;
      row = pair.luma->row;
      add(pair);
    }
  }
  const float prior = square(scatter_) + square(shift_) * 0.25f;
  if (!(weight > 0.0f)) return {here.luma->row - shift_, std::sqrt(luma_variance + prior)};
  const float variance = std::min(columns, kSharedColumns) / weight;
  const float gain = prior / (prior + variance);
  return {here.luma->row - shift_ - gain * (sum / weight - shift_),
          std::sqrt(luma_variance + gain * variance)};
}

const std::vector<EdgeFusion::Edge>& EdgeFusion::fuse(const std::vector<Pair>& pairs) {
  measureScene(pairs);
  edges_.resize(pairs.size());
  for (std::size_t u = 0; u < pairs.size(); ++u) edges_[u] = fuseColumn(pairs, u);
  return edges_;
}

}  // namespace omnifleet::distance_vector
