#include "ground/edge_refiner.h"

#include <algorithm>
#include <cmath>
#include <optional>

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

/// Bilinear sample of channel c; NaN outside.
float sample(const cv::Mat& image, int channels, int c, float u, float v) {
  if (!(u >= 0.0f && v >= 0.0f)) return NAN;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  if (x + 1 >= image.cols || y + 1 >= image.rows) return NAN;
  const std::uint8_t* top = image.ptr<std::uint8_t>(y) + x * channels + c;
  const std::uint8_t* bottom = image.ptr<std::uint8_t>(y + 1) + x * channels + c;
  const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
  const float above = static_cast<float>(top[0]) + fu * static_cast<float>(top[channels] - top[0]);
  const float below = static_cast<float>(bottom[0]) + fu * static_cast<float>(bottom[channels] - bottom[0]);
  return above + fv * (below - above);
}

cv::Vec3f colourAt(const cv::Mat& image, const Eigen::Vector2f& p) {
  const int channels = image.channels();
  cv::Vec3f colour;
  for (int c = 0; c < 3; ++c) colour[c] = sample(image, channels, channels == 3 ? c : 0, p.x(), p.y());
  return colour;
}

struct FloorBeside {
  cv::Vec3f colour;
  bool in_shadow;  ///< clearly
};

/// The floor as it is there, where that is the reference in another light (beside a thing lies its shadow);
/// else the reference, which has less noise.
FloorBeside floorBeside(const ContourFrame& frame, const Eigen::Vector2f& p, const Eigen::Vector2f& inward,
                        const cv::Vec3f& reference) {
  const cv::Vec3f seen = 0.5f * (colourAt(frame.image, p) + colourAt(frame.image, p - inward));
  const float rr = std::max(1.0f, reference.dot(reference));
  const float gain = seen.dot(reference) / rr, across2 = seen.dot(seen) / rr - gain * gain;
  const bool in_other_light = gain > kDeepestShade && gain < 1.0f - kSameLight;  // false for NaN
  if (!in_other_light || across2 >= kSameHue * kSameHue * gain * gain) return {reference, false};
  return {seen, gain < 1.0f - kDeepLight};
}

float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
  return a.x() * b.y() - a.y() * b.x();
}

struct Line {
  Eigen::Vector2f middle, direction;
};

/// Total least squares through points[(first + k) mod n], k < count.
Line fitLine(const std::vector<Eigen::Vector2f>& points, std::size_t first, std::size_t count) {
  Eigen::Vector2f mean(0, 0);
  for (std::size_t k = 0; k < count; ++k) mean += points[(first + k) % points.size()];
  mean /= static_cast<float>(count);
  float xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector2f d = points[(first + k) % points.size()] - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  const float angle = 0.5f * std::atan2(2.0f * xy, xx - yy);
  return {mean, {std::cos(angle), std::sin(angle)}};
}

std::optional<Eigen::Vector2f> intersection(const Line& a, const Line& b) {
  const float turn = cross(a.direction, b.direction);
  if (std::abs(turn) < 0.5f * kMinTurn) return std::nullopt;
  return a.middle + cross(b.middle - a.middle, b.direction) / turn * a.direction;
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
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2f along = points[(i + kTangent) % n] - points[(i + n - kTangent) % n];
    const float length = along.norm();
    if (length < 1e-3f || view_->nearBorder(points[i].x(), points[i].y())) continue;
    const Eigen::Vector2f inward(-along.y() / length, along.x() / length);
    is_found_[i] = findEdge(frame, inward, beside[i] == 0, found_[i]) ? 1 : 0;
  }
}

bool EdgeRefiner::findEdge(const ContourFrame& frame, const Eigen::Vector2f& inward, bool floor_beside,
                           Eigen::Vector2f& point) const {
  const Eigen::Vector2f p = point;
  const int cx = std::clamp(static_cast<int>(p.x() + 0.5f) / FloorView::kCell, 0, frame.floor.cols - 1);
  const int cy = std::clamp(static_cast<int>(p.y() + 0.5f) / FloorView::kCell, 0, frame.floor.rows - 1);
  const Eigen::Vector2f out = p - (static_cast<float>(options_.search_px) + kBeyond_px) * inward;
  const cv::Vec3f& reference = frame.floor(cy, cx);
  const FloorBeside beside = floor_beside ? floorBeside(frame, out, inward, reference)
                                          : FloorBeside{colourAt(frame.image, out), false};
  const cv::Vec3f& outside = beside.colour;
  auto search = static_cast<float>(options_.search_px);
  cv::Vec3f contrast = colourAt(frame.image, p + (search + kBeyond_px) * inward) - outside;
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
    contrast = colourAt(frame.image, p + search * inward) - outside;
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
        by_luma ? sample(frame.grey, 1, 0, at.x(), at.y()) : colourAt(frame.image, at).dot(weight);
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
  for (std::size_t i = 0; i < n; ++i) {
    Eigen::Vector2f sum(0, 0);
    bool whole = true;
    for (std::size_t k = 0; k < 7; ++k) {
      const std::size_t at = (i + n - 3 + k) % n;
      whole = whole && is_found_[at] != 0;
      sum += kWeight[k] * found_[at];
    }
    if (whole) smoothed_[i] = sum;
  }
}

void EdgeRefiner::sharpen(Eigen::Vector2f* points) const {
  const std::size_t n = found_.size();
  const auto turnAt = [&](std::size_t i) {
    const Eigen::Vector2f in = smoothed_[i] - smoothed_[(i + n - 5) % n],
                          out = smoothed_[(i + 5) % n] - smoothed_[i];
    return cross(in, out) / std::max(1e-6f, in.norm() * out.norm());
  };
  for (std::size_t i = 0; i < n; ++i) {
    const float turn = turnAt(i);
    if (turn < kMinTurn || is_found_[i] == 0) continue;  // only corners that stick out count for a hull
    bool sharpest = true;
    for (std::size_t k = 1; k <= 4 && sharpest; ++k)
      sharpest = turnAt((i + k) % n) <= turn && turnAt((i + n - k) % n) < turn;
    if (!sharpest) continue;
    const Line before = fitLine(found_, i + n - kSkip - kSide + 1, kSide),
               after = fitLine(found_, i + kSkip, kSide);
    const auto corner = intersection(before, after);
    if (corner && (*corner - smoothed_[i]).norm() <= kMaxDepth_px) points[i] = *corner;
  }
}

}  // namespace omnifleet::ground
