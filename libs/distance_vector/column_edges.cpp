#include "distance_vector/column_edges.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace omnifleet::distance_vector {
namespace {

constexpr int kReach_px = 16;  // of the profile to both sides of the expected row
constexpr int kLength = 2 * kReach_px + 1;
constexpr float kWindow_px = 2.0f;                          // half width of the area that places the edge
constexpr float kPlateau_px = 2.0f, kPlateauEnd_px = 7.0f;  // of the object
constexpr float kFloor_px = 2.0f, kFloorEnd_px = 9.0f;      // of the line through the floor
constexpr int kLeastFloor_px = 2;                           // pixels
constexpr float kProfileNoise = 2.0f;                       // grey levels, against which the prior counts
constexpr float kFarthest = 0.02f;                          // 1/m: farther floor counts as if it were here
constexpr int kRounds = 3;
constexpr float kNoiseSamples = 4.0f;  // weight of the pixel noise against the residuals of the floor
constexpr float kMostMove_px = 3.0f;   // of the edge during the rounds
constexpr int kLeastLength_px = 10;    // of a profile
constexpr float kColourNoise = 1.5f;   // noise of one channel ÷ noise of luma
constexpr float kTextureGain =
    1.3f;  // texture is similar in neighbouring rows: their mean varies more than noise
// An edge is smooth if a cubic explains the values around it (χ², 10 dof, 99.9 %) and two lines do not
// explain them better: they have as many coefficients, and the edge's place, so by ln 14 for the BIC of 14
// values.
constexpr float kSmooth = 29.6f, kSharp = 2.6f;
constexpr float kLuma[3] = {0.114f, 0.587f, 0.299f};

float luma(const std::uint8_t* p) {
  return kLuma[0] * p[0] + kLuma[1] * p[1] + kLuma[2] * p[2];
}

}  // namespace

/// Values along the column; index i is i − kReach_px pixels above the expected row.
struct ColumnEdges::Profile {
  std::array<float, kLength> value;
  std::array<float, kLength> range_m;  ///< of the floor; decreasing with the distance from the edge downwards
  int first = 0, end = kLength;        ///< indices inside the image

  float at(float i) const { return mixed(value, i); }
  float rangeAt(float i) const { return mixed(range_m, i); }
  float mixed(const std::array<float, kLength>& table, float i) const {
    const float x = std::clamp(i, static_cast<float>(first), static_cast<float>(end) - 1.001f);
    const auto k = static_cast<std::size_t>(x);
    const float f = x - static_cast<float>(k);
    return table[k] * (1.0f - f) + table[k + 1] * f;
  }
};

namespace {

/// The floor below an edge: value = level + slope·(range − range of the edge). Light that falls off evenly is
/// linear in the range, not in the rows.
struct FloorLine {
  float level = 0.0f, slope = 0.0f;  ///< grey levels, and per metre
  float squares = 0.0f;              ///< of the residuals
  float variance = 1.0f;             ///< of the level, in units of the variance of a value
  int n = 0;
};

/// @param slope_share 1/m: σ of the slope before the fit, share of the level
template <class Profile>
FloorLine fitFloor(const Profile& profile, float edge, float slope_share) {
  float n = 0, sx = 0, sxx = 0, sy = 0, sxy = 0, syy = 0;
  const int from = std::max(profile.first, static_cast<int>(std::ceil(edge - kFloorEnd_px))),
            to = static_cast<int>(std::floor(edge - kFloor_px));
  const float edge_m = profile.rangeAt(edge);
  for (int i = from; i <= to; ++i) {
    const float x = profile.range_m[static_cast<std::size_t>(i)] - edge_m,
                y = profile.value[static_cast<std::size_t>(i)];
    n += 1.0f;
    sx += x;
    sxx += x * x;
    sy += y;
    sxy += x * y;
    syy += y * y;
  }
  FloorLine line;
  line.n = static_cast<int>(n);
  if (line.n < kLeastFloor_px) return line;
  const float prior = std::max(1.0f, std::abs(sy / n)) * slope_share;
  const float xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
  const float information = xx + kProfileNoise * kProfileNoise / (prior * prior);
  line.slope = xy / information;
  line.variance = 1.0f / n + sx * sx / (n * n) / information;
  line.level = (sy - line.slope * sx) / n;
  line.squares = std::max(0.0f, yy - 2.0f * line.slope * xy + line.slope * line.slope * xx);
  return line;
}

/// The object above an edge: value = level + slope·(pixels above the edge). The foot of a face is often
/// darker: the floor takes its light.
struct FaceLine {
  float level = 0.0f, slope = 0.0f;  ///< grey levels, and per pixel
  float squares = 0.0f;              ///< of the residuals
  float variance = 1.0f;             ///< of the level, in units of the variance of a value
  int n = 0;
};

/// @param slope_share 1/px: σ of the slope before the fit, share of the level's contrast
template <class Profile>
FaceLine fitFace(const Profile& profile, float edge, float slope_share) {
  float n = 0, sx = 0, sxx = 0, sy = 0, sxy = 0, syy = 0;
  const int from = static_cast<int>(std::ceil(edge + kPlateau_px)),
            to = std::min(profile.end - 1, static_cast<int>(std::floor(edge + kPlateauEnd_px)));
  for (int i = from; i <= to; ++i) {
    const float x = static_cast<float>(i) - edge, y = profile.value[static_cast<std::size_t>(i)];
    n += 1.0f;
    sx += x;
    sxx += x * x;
    sy += y;
    sxy += x * y;
    syy += y * y;
  }
  FaceLine line;
  line.n = static_cast<int>(n);
  if (line.n < 2) return line;
  const float prior = std::max(1.0f, std::abs(sy / n)) * slope_share;
  const float xx = sxx - sx * sx / n, xy = sxy - sx * sy / n, yy = syy - sy * sy / n;
  const float information = xx + kProfileNoise * kProfileNoise / (prior * prior);
  line.slope = xy / information;
  line.variance = 1.0f / n + sx * sx / (n * n) / information;
  line.level = (sy - line.slope * sx) / n;
  line.squares = std::max(0.0f, yy - 2.0f * line.slope * xy + line.slope * line.slope * xx);
  return line;
}

/// Squares of the residuals if there is no edge: one cubic through the values of both lines, by orthogonal
/// polynomials (Forsythe 1957).
template <class Profile>
float smoothSquares(const Profile& profile, float edge) {
  constexpr int kDegree = 3;
  struct Sample {
    float x, y, p, before;
  };
  std::array<Sample, kLength> samples;
  std::size_t n = 0;
  const auto add = [&](int from, int to) {
    for (int i = from; i <= to; ++i)
      samples[n++] = {(static_cast<float>(i) - edge) / kFloorEnd_px,
                      profile.value[static_cast<std::size_t>(i)], 1.0f, 0.0f};
  };
  add(std::max(profile.first, static_cast<int>(std::ceil(edge - kFloorEnd_px))),
      static_cast<int>(std::floor(edge - kFloor_px)));
  add(static_cast<int>(std::ceil(edge + kPlateau_px)),
      std::min(profile.end - 1, static_cast<int>(std::floor(edge + kPlateauEnd_px))));
  float norm_before = 1.0f, squares = 0.0f;
  for (int k = 0; k <= kDegree; ++k) {
    float norm = 0.0f, along = 0.0f, middle = 0.0f;
    for (std::size_t i = 0; i < n; ++i) {
      const Sample& s = samples[i];
      norm += s.p * s.p;
      along += s.p * s.y;
      middle += s.x * s.p * s.p;
    }
    if (!(norm > 1e-9f)) return 0.0f;  // no more samples than coefficients
    along /= norm;
    middle /= norm;
    const float back = k > 0 ? norm / norm_before : 0.0f;
    squares = 0.0f;
    for (std::size_t i = 0; i < n; ++i) {
      Sample& s = samples[i];
      s.y -= along * s.p;
      squares += s.y * s.y;
      const float next = (s.x - middle) * s.p - back * s.before;
      s.before = s.p;
      s.p = next;
    }
    norm_before = norm;
  }
  return squares;
}

/// The nearest clear step of the profile around `expected`.
template <class Profile>
bool locate(const Profile& profile, float expected, float max_shift, float& edge) {
  constexpr float kClear = 0.5f;  // of the largest step
  const int from = std::max(profile.first + 2, static_cast<int>(expected) - 3),
            to = std::min(profile.end - 3, static_cast<int>(expected + max_shift));
  std::array<float, kLength> steps{};
  float largest = 0.0f;
  for (int i = from; i <= to; ++i) {
    const auto k = static_cast<std::size_t>(i);
    steps[k] =
        std::abs(profile.value[k + 1] + profile.value[k + 2] - profile.value[k] - profile.value[k - 1]);
    largest = std::max(largest, steps[k]);
  }
  for (int i = from; i <= to; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (steps[k] < kClear * largest || (i < to && steps[k + 1] > steps[k])) continue;
    edge = static_cast<float>(i) + 0.5f;
    return true;
  }
  return false;
}

}  // namespace

std::optional<ColumnEdges::Edge> ColumnEdges::measure(const Profile& profile, int row, float noise,
                                                      float fixed_px, float least_contrast) const {
  float edge = 0.0f, contrast = 0.0f, face_variance = 0.0f;
  if (!locate(profile, static_cast<float>(kReach_px), static_cast<float>(options_.max_shift_px), edge))
    return std::nullopt;
  const float begun = edge;
  FloorLine line;
  FaceLine face;
  for (int round = 0; round < kRounds; ++round) {
    line = fitFloor(profile, edge, static_cast<float>(options_.falloff_per_m));
    const float edge_m = profile.rangeAt(edge);
    face = fitFace(profile, edge, static_cast<float>(options_.shading_per_px));
    if (line.n < kLeastFloor_px || face.n < 2) return std::nullopt;
    contrast = face.level - line.level;
    face_variance = face.variance;
    if (std::abs(contrast) < 1.0f) return std::nullopt;
    float outside = 0.0f;
    int samples = 0;
    constexpr float kStep_px = 0.25f;
    for (float d = -kWindow_px + 0.5f * kStep_px; d < kWindow_px; d += kStep_px, ++samples) {
      const float range_m = profile.rangeAt(edge + std::min(d, 0.0f));
      const float floor = line.level + line.slope * (range_m - edge_m);
      const float object = face.level + face.slope * std::max(d, 0.0f);
      outside += std::clamp((profile.at(edge + d) - floor) / (object - floor), -0.5f, 1.5f);
    }
    edge += std::clamp((0.5f - outside / static_cast<float>(samples)) * 2.0f * kWindow_px, -1.5f, 1.5f);
    if (std::abs(edge - begun) > kMostMove_px) return std::nullopt;
  }
  // The floor's own deviations, with the pixel noise as prior.
  const float variance = (kNoiseSamples * noise * noise + line.squares) /
                         (kNoiseSamples + std::max(0.0f, static_cast<float>(line.n) - 1.5f));
  const float least = std::max(least_contrast, static_cast<float>(options_.min_sigmas) * std::sqrt(variance));
  if (std::abs(contrast) < least) return std::nullopt;
  const float smooth = smoothSquares(profile, edge);
  const bool is_smooth =
      smooth < kSmooth * noise * noise && smooth - line.squares - face.squares < kSharp * variance;
  // The area over 2·kWindow_px values; half of it moves with the floor's level, half with the object's.
  const float gain = 2.0f * kWindow_px + kWindow_px * kWindow_px * (line.variance + face_variance);
  const float random = kTextureGain * std::sqrt(gain * variance) / std::abs(contrast);
  return Edge{static_cast<float>(row + kReach_px) - edge, std::sqrt(random * random + fixed_px * fixed_px),
              is_smooth};
}

ColumnEdges::Pair ColumnEdges::find(const cv::Mat& bgr, const ColumnView& view, int u, int row, bool weak,
                                    float noise) const {
  Profile profile;
  std::array<const std::uint8_t*, kLength> pixels;
  profile.first = std::max(0, row + kReach_px - (bgr.rows - 1));
  profile.end = std::min(kLength, row + kReach_px + 1);
  if (profile.end - profile.first < kLeastLength_px) return {};
  for (int i = profile.first; i < profile.end; ++i) {
    const auto k = static_cast<std::size_t>(i);
    pixels[k] = bgr.ptr<std::uint8_t>(row + kReach_px - i) + 3 * u;
    profile.value[k] = luma(pixels[k]);
    profile.range_m[k] =
        1.0f / std::max(kFarthest, view.inverseRange(u, static_cast<float>(row + kReach_px - i)));
  }
  Pair pair;
  pair.weak = weak;
  pair.luma = measure(profile, row, noise, static_cast<float>(options_.sigma_px),
                      weak ? 0.0f : static_cast<float>(options_.min_contrast));
  cv::Vec3f below(0, 0, 0), above(0, 0, 0);
  int n = 0, m = 0;
  for (int i = profile.first; i < profile.end; ++i) {
    const std::uint8_t* p = pixels[static_cast<std::size_t>(i)];
    const cv::Vec3f colour(p[0], p[1], p[2]);
    if (i >= kReach_px - 8 && i <= kReach_px - 3) below += colour, ++n;
    if (i >= kReach_px + 4 && i <= kReach_px + 8) above += colour, ++m;
  }
  if (n < kLeastFloor_px || m < 2) return pair;
  const cv::Vec3f own = below * (1.0f / std::max(1.0f, static_cast<float>(cv::norm(below))));
  cv::Vec3f axis = above - own * own.dot(above);
  const auto length = static_cast<float>(cv::norm(axis));
  if (length < static_cast<float>(m)) return pair;  // less than one grey level
  axis *= 1.0f / length;
  for (int i = profile.first; i < profile.end; ++i) {
    const auto k = static_cast<std::size_t>(i);
    profile.value[k] = axis[0] * pixels[k][0] + axis[1] * pixels[k][1] + axis[2] * pixels[k][2];
  }
  pair.hue = measure(profile, row, kColourNoise * noise, static_cast<float>(options_.hue_sigma_px),
                     weak ? 0.0f : static_cast<float>(options_.min_hue_contrast));
  return pair;
}

float ColumnEdges::noise(const cv::Mat& bgr, int first_row, int end_row) {
  constexpr float kPerLevel = 2.0f;                 // bins per grey level
  constexpr float kToSigma = 1.4826f / 2.4494897f;  // median of |a − 2b + c| → σ
  counts_.fill(0);
  int total = 0;
  for (int v = std::max(1, first_row); v + 1 < std::min(end_row, bgr.rows); v += 2) {
    const std::uint8_t *above = bgr.ptr<std::uint8_t>(v - 1), *here = bgr.ptr<std::uint8_t>(v),
                       *below = bgr.ptr<std::uint8_t>(v + 1);
    for (int u = 0; u < bgr.cols; u += 2) {
      const float second = luma(above + 3 * u) - 2.0f * luma(here + 3 * u) + luma(below + 3 * u);
      ++counts_[std::min(counts_.size() - 1, static_cast<std::size_t>(kPerLevel * std::abs(second)))];
      ++total;
    }
  }
  int seen = 0;
  for (std::size_t bin = 0; bin < counts_.size(); ++bin) {
    if (2 * (seen + counts_[bin]) < total || counts_[bin] == 0) {
      seen += counts_[bin];
      continue;
    }
    const float part =
        (0.5f * static_cast<float>(total) - static_cast<float>(seen)) / static_cast<float>(counts_[bin]);
    return std::max(0.3f, kToSigma * (static_cast<float>(bin) + part) / kPerLevel);
  }
  return 1.0f;
}

}  // namespace omnifleet::distance_vector
