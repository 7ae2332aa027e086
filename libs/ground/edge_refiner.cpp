#include "ground/edge_refiner.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>
#include <optional>

#include "geometry/wide.h"
#include "ground/look.h"

namespace omnifleet::ground {

namespace {

const cv::Vec3f kLuma(0.114f, 0.587f, 0.299f);  // B, G, R (BT.601, as JPEG keeps it at full resolution)
constexpr float kLumaShare =
    0.4f;  // of the contrast: from here on brightness alone is used, chroma being blurred
constexpr float kBeyond_px = 0.5f;    // behind the search: there the object's own brightness is taken
constexpr float kSameLight = 0.04f;   // of the brightness: within it the reference serves
constexpr float kDeepLight = 0.12f;   // likewise, from which it lies in a shadow that grows darker inward
constexpr float kHueShare = 0.3f;     // of the contrast, from which the hue alone tells the edge there
constexpr float kSameHue = 0.06f;     // of the brightness, by which the floor's colour may be off in shadow
constexpr float kStep_px = 0.5f;      // between the samples along the normal
constexpr std::size_t kTangent = 3;   // points to each side that give the tangent
constexpr std::size_t kSide = 5;      // points to each side of a corner that its lines are fitted to
constexpr std::size_t kSkip = 2;      // points next to a corner that are rounded
constexpr float kMinTurn = 0.64f;     // sine of the turn (40°) from which a corner may be one
constexpr float kMaxDepth_px = 1.0f;  // a rounder one is no corner but a curve
constexpr float kEvenDepth_px = 0.3f, kRounding_px = 1.2f;  // deepestRounding()

/// Bilinear samples of all channels. `kChecked`: false outside of the image; else only for what is inside.
template <bool kChecked, int kChannels>
OMNIFLEET_INLINE bool sampleAll(const cv::Mat& image, float u, float v, float (&out)[kChannels]) {
  if (kChecked && !(u >= 0.0f && v >= 0.0f)) return false;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  if (kChecked && (x + 1 >= image.cols || y + 1 >= image.rows)) return false;
  const std::uint8_t *top = image.ptr(y) + x * kChannels, *bottom = image.ptr(y + 1) + x * kChannels;
  const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
  for (int c = 0; c < kChannels; ++c) {
    const float above = static_cast<float>(top[c]) + fu * static_cast<float>(top[c + kChannels] - top[c]);
    const float below =
        static_cast<float>(bottom[c]) + fu * static_cast<float>(bottom[c + kChannels] - bottom[c]);
    out[c] = above + fv * (below - above);
  }
  return true;
}

/// NaN outside.
template <bool kChecked>
OMNIFLEET_INLINE float greyAt(const cv::Mat& grey, const Eigen::Vector2f& p) {
  float value[1] = {NAN};
  sampleAll<kChecked, 1>(grey, p.x(), p.y(), value);
  return value[0];
}

/// The three channels at once; reads one byte beyond the pixels it needs.
OMNIFLEET_INLINE cv::Vec3f colourInside(const cv::Mat& image, float u, float v) {
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const auto load = [](const std::uint8_t* pixel) {
    alignas(4) std::uint8_t four[4];  // v_load_expand_q reads them as one int
    std::memcpy(four, pixel, sizeof four);
    return cv::v_cvt_f32(cv::v_reinterpret_as_s32(cv::v_load_expand_q(four)));
  };
  const std::uint8_t *top = image.ptr(y) + 3 * x, *bottom = image.ptr(y + 1) + 3 * x;
  const cv::v_float32x4 fu = cv::v_setall_f32(u - static_cast<float>(x)),
                        fv = cv::v_setall_f32(v - static_cast<float>(y));
  const cv::v_float32x4 left = load(top), left_below = load(bottom);
  const cv::v_float32x4 above = left + fu * (load(top + 3) - left),
                        below = left_below + fu * (load(bottom + 3) - left_below);
  float value[4];
  cv::v_store(value, above + fv * (below - above));
  return {value[0], value[1], value[2]};
}

template <bool kChecked>
OMNIFLEET_INLINE cv::Vec3f colourAt(const cv::Mat& image, const Eigen::Vector2f& p) {
  if (image.channels() != 3) return cv::Vec3f::all(greyAt<kChecked>(image, p));
  if (!kChecked) return colourInside(image, p.x(), p.y());
  float value[3] = {NAN, NAN, NAN};
  sampleAll<kChecked, 3>(image, p.x(), p.y(), value);
  return {value[0], value[1], value[2]};
}

struct FloorBeside {
  cv::Vec3f colour;
  bool in_shadow;  ///< clearly
};

/// The floor as it is there, where that is the reference in another light (beside a thing lies its shadow);
/// else the reference, which has less noise.
template <bool kChecked>
OMNIFLEET_INLINE FloorBeside floorBeside(const ContourFrame& frame, const Eigen::Vector2f& p,
                                         const Eigen::Vector2f& inward, const cv::Vec3f& reference) {
  const cv::Vec3f seen =
      0.5f * (colourAt<kChecked>(frame.image, p) + colourAt<kChecked>(frame.image, p - inward));
  const float rr = std::max(1.0f, reference.dot(reference));
  const float gain = seen.dot(reference) / rr, across2 = seen.dot(seen) / rr - gain * gain;
  const bool in_other_light = gain > kDeepestShade && gain < 1.0f - kSameLight;  // false for NaN
  if (!in_other_light || across2 >= kSameHue * kSameHue * gain * gain) return {reference, false};
  return {seen, gain < 1.0f - kDeepLight};
}

float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// An index below 2n into a closed loop of n points.
std::size_t wrapped(std::size_t i, std::size_t n) {
  return i < n ? i : i - n;
}

struct Line {
  Eigen::Vector2f middle, direction;
};

/// Total least squares through points[(first + k) mod n], k < count; its direction is that of the walk.
Line fitLine(const std::vector<Eigen::Vector2f>& points, std::size_t first, std::size_t count) {
  Eigen::Vector2f mean(0, 0);
  for (std::size_t k = 0; k < count; ++k) mean += points[wrapped(first + k, points.size())];
  mean /= static_cast<float>(count);
  float xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector2f d = points[wrapped(first + k, points.size())] - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  const float angle = 0.5f * std::atan2(2.0f * xy, xx - yy);
  const Eigen::Vector2f direction(std::cos(angle), std::sin(angle));
  const Eigen::Vector2f walk =
      points[wrapped(first + count - 1, points.size())] - points[wrapped(first, points.size())];
  return {mean, direction.dot(walk) < 0.0f ? Eigen::Vector2f(-direction) : direction};
}

std::optional<Eigen::Vector2f> intersection(const Line& a, const Line& b) {
  const float turn = cross(a.direction, b.direction);
  if (std::abs(turn) < 0.5f * kMinTurn) return std::nullopt;
  return a.middle + cross(b.middle - a.middle, b.direction) / turn * a.direction;
}

/// Radians by which the walk turns from one line to the other; both directions agree with it.
float turnBetween(const Line& before, const Line& after) {
  return std::acos(std::clamp(before.direction.dot(after.direction), -1.0f, 1.0f));
}

/// How far pixels and smoothing round a true corner off, about as a circle of kRounding_px would. What lies
/// deeper is a narrow end (the rim of a cylinder seen from aside) and has no corner there.
float deepestRounding(float turn_rad) {
  const float depth =
      kEvenDepth_px + kRounding_px * (1.0f / std::max(0.1f, std::cos(0.5f * turn_rad)) - 1.0f);
  return std::min(kMaxDepth_px, depth);
}

}  // namespace

ContourOptions ContourOptions::read(const options::Section& section) {
  ContourOptions o;
  section.read("refine", o.refine);
  section.read("search_px", o.search_px, {0.5, 4.0});
  section.read("min_contrast", o.min_contrast, {0.5, 255.0});
  section.read("smooth", o.smooth);
  section.read("sharpen", o.sharpen);
  section.finish();
  return o;
}

void EdgeRefiner::refine(const ContourFrame& frame, Eigen::Vector2f* points, const std::uint8_t* beside,
                         std::size_t n) {
  if (!options_.refine || n < 2 * kTangent + 1) return;
  findEdges(frame, points, beside, n);
  smoothed_ = found_;
  if (options_.smooth) smooth();
  std::copy(smoothed_.begin(), smoothed_.end(), points);
  if (options_.sharpen && n >= 4 * kSide) sharpen(points);
}

void EdgeRefiner::findEdges(const ContourFrame& frame, const Eigen::Vector2f* points,
                            const std::uint8_t* beside, std::size_t n) {
  found_.assign(points, points + n);
  is_found_.assign(n, 0);
  // How far from a point the brightness is asked for.
  const float reach = std::max(2.0f * static_cast<float>(options_.search_px),
                               static_cast<float>(options_.search_px) + kBeyond_px + 1.0f);
  const auto right = static_cast<float>(frame.image.cols - 1),
             bottom = static_cast<float>(frame.image.rows - 1);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2f p = points[i];
    const Eigen::Vector2f along = points[wrapped(i + kTangent, n)] - points[wrapped(i + n - kTangent, n)];
    const float length = along.norm();
    if (length < 1e-3f || view_->nearBorder(p.x(), p.y())) continue;
    const Eigen::Vector2f inward(-along.y() / length, along.x() / length);
    const bool whole = p.x() > reach && p.y() > reach && p.x() + reach < right && p.y() + reach < bottom;
    const bool found = whole ? findEdge<false>(frame, inward, beside[i] == 0, found_[i])
                             : findEdge<true>(frame, inward, beside[i] == 0, found_[i]);
    is_found_[i] = found ? 1 : 0;
  }
}

template <bool kChecked>
bool EdgeRefiner::findEdge(const ContourFrame& frame, const Eigen::Vector2f& inward, bool floor_beside,
                           Eigen::Vector2f& point) const {
  const Eigen::Vector2f p = point;
  const int cx = std::clamp(static_cast<int>(p.x() + 0.5f) / FloorView::kCell, 0, frame.floor.cols - 1);
  const int cy = std::clamp(static_cast<int>(p.y() + 0.5f) / FloorView::kCell, 0, frame.floor.rows - 1);
  const Eigen::Vector2f out = p - (static_cast<float>(options_.search_px) + kBeyond_px) * inward;
  const cv::Vec3f& reference = frame.floor(cy, cx);
  const FloorBeside beside = floor_beside ? floorBeside<kChecked>(frame, out, inward, reference)
                                          : FloorBeside{colourAt<kChecked>(frame.image, out), false};
  const cv::Vec3f& outside = beside.colour;
  auto search = static_cast<float>(options_.search_px);
  cv::Vec3f contrast = colourAt<kChecked>(frame.image, p + (search + kBeyond_px) * inward) - outside;
  // A shadow grows darker towards the thing: its brightness has no step there, its hue has.
  const auto hueOf = [&](const cv::Vec3f& c) {
    return c - c.dot(reference) / std::max(1.0f, reference.dot(reference)) * reference;
  };
  const cv::Vec3f hue = beside.in_shadow ? hueOf(contrast) : cv::Vec3f(0, 0, 0);
  const float whole = std::sqrt(contrast.dot(contrast)), in_hue = std::sqrt(hue.dot(hue));
  const bool by_hue = in_hue >= std::max(kHueShare * whole, static_cast<float>(options_.min_contrast));
  const bool by_luma = !by_hue && std::abs(contrast.dot(kLuma)) >= kLumaShare * whole;
  if (!by_luma) {  // colour is blurred over twice the pixels
    search *= 2.0f;
    contrast = colourAt<kChecked>(frame.image, p + search * inward) - outside;
    if (by_hue) contrast = hueOf(contrast);
  }
  const float strength = std::sqrt(contrast.dot(contrast));
  if (!(strength > 0.0f)) return false;
  const cv::Vec3f weight = by_luma ? kLuma : contrast * (1.0f / strength);
  const float total = contrast.dot(weight), zero = outside.dot(weight);
  if (std::abs(total) < static_cast<float>(options_.min_contrast)) return false;
  float before = 0.0f;
  for (float s = -search; s <= search + 0.01f; s += kStep_px) {
    const Eigen::Vector2f at = p + s * inward;
    const float value =
        by_luma ? greyAt<kChecked>(frame.grey, at) : colourAt<kChecked>(frame.image, at).dot(weight);
    const float share = (value - zero) / total;
    if (share >= 0.5f) {
      if (!(s > -search)) return false;
      point = p + (s - (share - 0.5f) / std::max(share - before, 1e-6f) * kStep_px) * inward;
      return true;
    }
    before = share;
  }
  return false;
}

void EdgeRefiner::smooth() {
  // Savitzky–Golay, second order over seven points: keeps straight lines and curvature, halves the noise.
  static constexpr float kWeight[7] = {-2.0f / 21, 3.0f / 21, 6.0f / 21, 7.0f / 21,
                                       6.0f / 21,  3.0f / 21, -2.0f / 21};
  const std::size_t n = found_.size();
  std::size_t row = 0;  // consecutive points that were found, up to i + 3
  for (std::size_t k = 0; k < 6; ++k) row = is_found_[wrapped(n - 3 + k, n)] != 0 ? row + 1 : 0;
  for (std::size_t i = 0; i < n; ++i) {
    row = is_found_[wrapped(i + 3, n)] != 0 ? row + 1 : 0;
    if (row < 7) continue;
    Eigen::Vector2f sum(0, 0);
    for (std::size_t k = 0; k < 7; ++k) sum += kWeight[k] * found_[wrapped(wrapped(i + n - 3, n) + k, n)];
    smoothed_[i] = sum;
  }
}

void EdgeRefiner::sharpen(Eigen::Vector2f* points) const {
  const std::size_t n = found_.size();
  const auto turnAt = [&](std::size_t i) {
    const Eigen::Vector2f in = smoothed_[i] - smoothed_[wrapped(i + n - 5, n)],
                          out = smoothed_[wrapped(i + 5, n)] - smoothed_[i];
    return cross(in, out) / std::max(1e-6f, in.norm() * out.norm());
  };
  for (std::size_t i = 0; i < n; ++i) {
    const float turn = turnAt(i);
    if (turn < kMinTurn || is_found_[i] == 0) continue;  // only corners that stick out count for a hull
    bool sharpest = true;
    for (std::size_t k = 1; k <= 4 && sharpest; ++k)
      sharpest = turnAt(wrapped(i + k, n)) <= turn && turnAt(wrapped(i + n - k, n)) < turn;
    if (!sharpest) continue;
    const Line before = fitLine(found_, wrapped(i + n - kSkip - kSide + 1, n), kSide),
               after = fitLine(found_, wrapped(i + kSkip, n), kSide);
    const auto corner = intersection(before, after);
    if (corner && (*corner - smoothed_[i]).norm() <= deepestRounding(turnBetween(before, after)))
      points[i] = *corner;
  }
}

}  // namespace omnifleet::ground
