#include "distance_vector/bearing_sampler.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::distance_vector {
namespace {

constexpr std::size_t kLeastColumns = 2;   // of a piece, after its ends are dropped: fewer are specks
constexpr std::size_t kLeastTriples = 24;  // second differences that estimate the noise
constexpr std::size_t kEndFit = 5;         // columns that predict the end of their piece
constexpr float kBeyond = 0.4f;            // columns beyond the ends of a piece; a pixel sees half a column
constexpr std::size_t kLag = 6;            // columns: beyond the texture that neighbours share
constexpr float kLeastScale = 0.7f, kMostScale = 5.0f;

bool isOnFloor(const ColumnHit& hit) {
  return hit.end == End::kEdge || hit.end == End::kFloorEnd;
}

}  // namespace

void BearingSampler::clear(const Eigen::Vector2d& origin_m, double blind_m) {
  const auto n = static_cast<std::size_t>(options_.bearings);
  boundary_.origin_m = scan_.origin_m = origin_m;
  scan_.blind_m = blind_m;
  boundary_.inverse_m.assign(n, 0.0f);
  boundary_.sigma.assign(n, 0.0f);
  boundary_.moving.clear();
  scan_.range_m.assign(n, 0.0f);
  scan_.sigma_m.assign(n, 0.0f);
  scan_.label.assign(n, RayLabel::kInvalid);
  scan_.object.assign(n, 0);
}

void BearingSampler::sample(std::vector<ColumnHit>& hits, const Eigen::Vector2d& origin_m, double blind_m) {
  clear(origin_m, blind_m);
  findPieces(hits);
  scaleNoise(hits);
  dropOutliers(hits);
  dropSilhouettes(hits);
  for (std::size_t i = 0; i < hits.size();) {
    if (dropped_[i]) {
      ++i;
      continue;
    }
    std::size_t end = i + 1;
    while (end < hits.size() && !dropped_[end] && joined_[end - 1]) ++end;
    const std::size_t least =
        hits[i].end == End::kEdge ? kLeastColumns : static_cast<std::size_t>(options_.min_floor_end);
    if (end - i >= std::max(kLeastColumns, least)) samplePiece(hits, i, end);
    i = end;
  }
}

/// True if column i + 1 continues the edge of column i: a small step, or a steep line on either side.
bool BearingSampler::follows(const std::vector<ColumnHit>& hits, std::size_t i) const {
  const ColumnHit &a = hits[i], &b = hits[i + 1];
  if (a.end != b.end || !isOnFloor(a)) return false;
  if (a.end == End::kFloorEnd) return true;
  const auto jump = static_cast<float>(options_.jump_px);
  const float step = b.row - a.row;
  if (std::abs(step) <= jump) return true;
  // Two more steps of the same size on one side: a mixed column makes two steps of about half the jump each.
  const auto steep = [&](std::size_t first) {
    for (std::size_t k = first; k < first + 2; ++k) {
      if (hits[k].end != End::kEdge || hits[k + 1].end != End::kEdge) return false;
      if (std::abs(hits[k + 1].row - hits[k].row - step) > 0.5f * jump) return false;
    }
    return true;
  };
  const bool left = i >= 2 && steep(i - 2), right = i + 3 < hits.size() && steep(i + 1);
  return left || right;
}

void BearingSampler::findPieces(const std::vector<ColumnHit>& hits) {
  joined_.assign(hits.size(), 0);
  dropped_.assign(hits.size(), 0);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!isOnFloor(hits[i])) dropped_[i] = 1;
    if (i + 1 < hits.size()) joined_[i] = follows(hits, i) ? 1 : 0;
  }
}

/// Second differences over one column show the pixel noise; over several columns also the texture of the
/// floor, which neighbouring columns share. Both are zero on straight edges.
float BearingSampler::differenceScale(const std::vector<ColumnHit>& hits, std::size_t lag) {
  constexpr float kToSigma = 1.4826f;
  ratios_.clear();
  std::size_t run = 0;  // columns that follow each other, up to i
  for (std::size_t i = 0; i < hits.size(); ++i) {
    run = hits[i].end != End::kEdge ? 0 : i > 0 && joined_[i - 1] ? run + 1 : 1;
    if (run <= 2 * lag) continue;
    const ColumnHit &a = hits[i - 2 * lag], &b = hits[i - lag], &c = hits[i];
    // Columns are not evenly spaced in bearing.
    const float f = (a.bearing_rad - b.bearing_rad) / (a.bearing_rad - c.bearing_rad);
    if (!(f > 0.0f && f < 1.0f)) continue;
    const float x = (1.0f - f) * a.sigma, y = b.sigma, z = f * c.sigma;
    ratios_.push_back(std::abs((1.0f - f) * a.inverse_m + f * c.inverse_m - b.inverse_m) /
                      std::sqrt(x * x + y * y + z * z));
  }
  if (ratios_.size() < kLeastTriples) return 1.0f;
  const auto middle = ratios_.begin() + static_cast<std::ptrdiff_t>(ratios_.size() / 2);
  std::nth_element(ratios_.begin(), middle, ratios_.end());
  return kToSigma * *middle;
}

void BearingSampler::scaleNoise(std::vector<ColumnHit>& hits) {
  noise_scale_ =
      std::clamp(std::max(differenceScale(hits, 1), differenceScale(hits, kLag)), kLeastScale, kMostScale);
  for (ColumnHit& hit : hits)
    if (hit.end == End::kEdge) hit.sigma *= noise_scale_;
}

/// Drops a column that neither the line through its left neighbours nor that through its right neighbours nor
/// the value between both explains.
void BearingSampler::dropOutliers(const std::vector<ColumnHit>& hits) {
  const auto limit = static_cast<float>(options_.outlier_sigmas);
  for (std::size_t i = 1; i + 1 < hits.size(); ++i) {
    if (hits[i].end != End::kEdge) continue;
    const auto misses = [&](float expected, float gain) {
      return std::abs(hits[i].inverse_m - expected) > limit * gain * hits[i].sigma;
    };
    const bool left = i >= 2 && joined_[i - 1] && joined_[i - 2],
               right = i + 2 < hits.size() && joined_[i] && joined_[i + 1];
    const bool both = joined_[i - 1] && joined_[i];
    bool explained = !left && !right && !both;
    if (left) explained = explained || !misses(2.0f * hits[i - 1].inverse_m - hits[i - 2].inverse_m, 2.45f);
    if (right) explained = explained || !misses(2.0f * hits[i + 1].inverse_m - hits[i + 2].inverse_m, 2.45f);
    if (both) explained = explained || !misses(0.5f * (hits[i - 1].inverse_m + hits[i + 1].inverse_m), 1.22f);
    if (!explained) dropped_[i] = 1;
  }
}

/// Drops the columns at the ends of each piece that do not continue it: they show parts of both surfaces.
void BearingSampler::dropSilhouettes(const std::vector<ColumnHit>& hits) {
  for (std::size_t begin = 0; begin < hits.size();) {
    std::size_t end = begin + 1;
    while (end < hits.size() && joined_[end - 1]) ++end;
    if (hits[begin].end == End::kEdge) {
      trim(hits, begin, end, begin > 0, false);
      trim(hits, begin, end, end < hits.size(), true);
    }
    begin = end;
  }
}

/// @param silhouette the piece ends there; otherwise at the border of the image @param last at its right end
void BearingSampler::trim(const std::vector<ColumnHit>& hits, std::size_t begin, std::size_t end,
                          bool silhouette, bool last) {
  if (!silhouette) return;
  const std::size_t columns = end - begin;
  const auto most = static_cast<std::size_t>(options_.jump_columns);
  for (std::size_t k = 0; k < most; ++k) {
    const std::size_t at = last ? end - 1 - k : begin + k;
    if (columns < k + 1 + kEndFit) {  // too short for a fit: drop what may be mixed
      if (k == 0) dropped_[at] = 1;
      return;
    }
    // Line through the next columns, in inverse range over bearing.
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, variance = 0;
    for (std::size_t j = 1; j <= kEndFit; ++j) {
      const ColumnHit& hit = hits[last ? at - j : at + j];
      const double x = static_cast<double>(hit.bearing_rad - hits[at].bearing_rad);
      n += 1.0;
      sx += x;
      sy += static_cast<double>(hit.inverse_m);
      sxx += x * x;
      sxy += x * static_cast<double>(hit.inverse_m);
      variance += static_cast<double>(hit.sigma * hit.sigma);
    }
    const double spread = sxx - sx * sx / n;
    if (!(spread > 0.0)) return;
    const double slope = (sxy - sx * sy / n) / spread, expected = (sy - slope * sx) / n;
    const double sigma = static_cast<double>(hits[at].sigma);
    const double total = sigma * sigma + variance / n * (1.0 / n + sx * sx / (n * n) / spread);
    if (std::abs(static_cast<double>(hits[at].inverse_m) - expected) <=
        options_.silhouette_sigmas * std::sqrt(total))
      return;
    dropped_[at] = 1;
  }
}

void BearingSampler::set(int bin, RayLabel label, float inverse_m, float sigma) {
  const int n = options_.bearings;
  const auto i = static_cast<std::size_t>(((bin % n) + n) % n);
  if (!(inverse_m > 0.0f)) return;
  // Where two pieces share a bearing, the nearer one ends the ray.
  if (scan_.label[i] != RayLabel::kInvalid && 1.0f / inverse_m >= scan_.range_m[i]) return;
  scan_.range_m[i] = 1.0f / inverse_m;
  scan_.sigma_m[i] = sigma / (inverse_m * inverse_m);
  scan_.label[i] = label;
  const bool is_edge = label == RayLabel::kObstacle;
  boundary_.inverse_m[i] = is_edge ? inverse_m : 0.0f;
  boundary_.sigma[i] = is_edge ? sigma : 0.0f;
}

/// Bearings fall from left to right. Columns begin..end−1 follow each other.
void BearingSampler::samplePiece(const std::vector<ColumnHit>& hits, std::size_t begin, std::size_t end) {
  const float bin_rad = static_cast<float>(2.0 * M_PI) / static_cast<float>(options_.bearings);
  const End kind = hits[begin].end;
  std::size_t i = begin, first = begin;
  const float left = kBeyond * (hits[begin].bearing_rad - hits[begin + 1].bearing_rad),
              right = kBeyond * (hits[end - 2].bearing_rad - hits[end - 1].bearing_rad);
  const int high = static_cast<int>(std::floor((hits[begin].bearing_rad + left) / bin_rad)),
            low = static_cast<int>(std::ceil((hits[end - 1].bearing_rad - right) / bin_rad));
  for (int bin = high; bin >= low; --bin) {
    const float bearing = static_cast<float>(bin) * bin_rad;
    while (i + 2 < end && hits[i + 1].bearing_rad > bearing) ++i;
    const ColumnHit &a = hits[i], &b = hits[i + 1];
    const float across = a.bearing_rad - b.bearing_rad;
    if (!(across > 0.0f)) continue;
    const float f = std::clamp((a.bearing_rad - bearing) / across, -kBeyond, 1.0f + kBeyond);
    if (kind == End::kFloorEnd) {
      set(bin, RayLabel::kFloorEnd, std::max(a.inverse_m, b.inverse_m), std::max(a.sigma, b.sigma));
      continue;
    }
    const RayLabel label = a.low || b.low         ? RayLabel::kUndecided
                           : a.beyond || b.beyond ? RayLabel::kBeyond
                                                  : RayLabel::kObstacle;
    while (first < end && hits[first].bearing_rad > bearing + 0.5f * bin_rad) ++first;
    float weight = 0.0f, sum = 0.0f, place = 0.0f;
    int n = 0;
    for (std::size_t k = first; k < end && hits[k].bearing_rad >= bearing - 0.5f * bin_rad; ++k, ++n) {
      const float w = 1.0f / (hits[k].sigma * hits[k].sigma);
      weight += w;
      sum += w * hits[k].inverse_m;
      place += w * hits[k].bearing_rad;
    }
    // What neighbouring columns share neither shows in differences nor averages out.
    const auto shared = static_cast<float>(options_.shared_px) * ((1.0f - f) * a.per_px + f * b.per_px);
    if (n >= 2) {
      const std::size_t last = first + static_cast<std::size_t>(n) - 1;
      const ColumnHit &from = hits[first >= begin + 2 ? first - 2 : begin],
                      &to = hits[std::min(end - 1, last + 2)];
      const float slope = (from.inverse_m - to.inverse_m) / (from.bearing_rad - to.bearing_rad);
      set(bin, label, sum / weight + slope * (bearing - place / weight),
          std::sqrt(1.0f / weight + shared * shared));
    } else {
      const float s = (1.0f - f) * a.sigma, t = f * b.sigma;
      set(bin, label, (1.0f - f) * a.inverse_m + f * b.inverse_m, std::sqrt(s * s + t * t + shared * shared));
    }
  }
}

}  // namespace omnifleet::distance_vector
