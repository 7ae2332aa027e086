#include "ground/edge_refiner.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace omnifleet::ground {

namespace {

constexpr std::size_t kAhead = 16;    // points to prefetch ahead
constexpr std::size_t kTangent = 3;   // points on each side that define the tangent
constexpr std::size_t kSide = 5;      // points on each side of a corner for its line fits
constexpr std::size_t kSkip = 2;      // rounded points next to a corner
constexpr std::size_t kPlenty = 180;  // points; larger outlines skip every other point of straight parts
constexpr std::size_t kBend = 6;      // points on each side for the straightness test
constexpr float kMaxBend = 0.35f;  // maximum sine of the turn of a straight part; the pixel grid makes steps
constexpr float kMinTurn = 0.64f;  // minimum sine of the turn at a corner (40°)
constexpr float kMaxDepth_px = 1.0f;                        // a larger rounding is a curve
constexpr float kEvenDepth_px = 0.3f, kRounding_px = 1.2f;  // see deepestRounding()

float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Wraps an index below 2n into a closed loop of n points.
std::size_t wrapped(std::size_t i, std::size_t n) {
  return i < n ? i : i - n;
}

struct Line {
  Eigen::Vector2f middle, direction;
};

/// Total least squares line through points[(first + k) mod n], k < count. Its direction follows the order of
/// the points.
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

/// Turn from one line to the other, radians. Both directions follow the order of the points.
float turnBetween(const Line& before, const Line& after) {
  return std::acos(std::clamp(before.direction.dot(after.direction), -1.0f, 1.0f));
}

/// Maximum distance by which pixels and smoothing round off a true corner, about as a circle of radius
/// kRounding_px does. A larger distance means a narrow curved end (the rim of a cylinder seen from the side).
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

std::size_t EdgeRefiner::refine(const ContourFrame& frame, Eigen::Vector2f* points, std::uint8_t* beside,
                                std::size_t n) {
  if (!options_.refine || n < 2 * kTangent + 1) return n;
  findSkipped(points, n);
  findEdges(frame, points, beside, n);
  fillSkipped();
  smoothed_ = found_;
  if (options_.smooth) smooth();
  std::copy(smoothed_.begin(), smoothed_.end(), points);
  if (options_.sharpen && n >= 4 * kSide) sharpen(points);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (is_skipped_[i] != 0) continue;
    points[kept] = points[i];
    beside[kept++] = beside[i];
  }
  return kept;
}

/// Marks every other point of the straight parts of a large outline. Its neighbours carry the same
/// information.
void EdgeRefiner::findSkipped(const Eigen::Vector2f* points, std::size_t n) {
  is_skipped_.assign(n, 0);
  if (n < kPlenty) return;
  for (std::size_t i = 1; i < n; i += 2) {
    const Eigen::Vector2f in = points[i] - points[wrapped(i + n - kBend, n)],
                          out = points[wrapped(i + kBend, n)] - points[i];
    const float turn = cross(in, out);
    const bool straight =
        in.dot(out) > 0.0f && turn * turn < kMaxBend * kMaxBend * in.squaredNorm() * out.squaredNorm();
    is_skipped_[i] = straight ? 1 : 0;
  }
}

/// The data along an outline is rarely in the cache.
void EdgeRefiner::prefetch(const ContourFrame& frame, const Eigen::Vector2f& p) const {
  view_->prefetchBorder(p.x(), p.y());
  const int x = std::clamp(static_cast<int>(p.x()), 0, frame.image.cols - 1),
            y = std::clamp(static_cast<int>(p.y()), 0, frame.image.rows - 1);
  __builtin_prefetch(frame.floor.ptr(std::min(y / FloorView::kCell, frame.floor.rows - 1)) +
                     std::min(x / FloorView::kCell, frame.floor.cols - 1));
}

void EdgeRefiner::findEdges(const ContourFrame& frame, const Eigen::Vector2f* points,
                            const std::uint8_t* beside, std::size_t n) {
  found_.assign(points, points + n);
  is_found_.assign(n, 0);
  std::size_t which[EightEdges::kCount];
  int count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    prefetch(frame, points[std::min(i + kAhead, n - 1)]);
    const Eigen::Vector2f& p = points[i];
    if (is_skipped_[i] != 0 || view_->nearBorder(p.x(), p.y())) continue;
    const Eigen::Vector2f along = points[wrapped(i + kTangent, n)] - points[wrapped(i + n - kTangent, n)];
    which[count] = i;
    put(frame.floor, p, along, beside[i], count++);
    if (count == EightEdges::kCount) count = takeEdges(frame, which, count);
  }
  if (count > 0) takeEdges(frame, which, count);
}

/// Sets a skipped point to the middle between the edges on both sides, if both were found.
void EdgeRefiner::fillSkipped() {
  const std::size_t n = found_.size();
  for (std::size_t i = 1; i < n; i += 2) {
    const std::size_t before = i - 1, after = wrapped(i + 1, n);
    if (is_skipped_[i] == 0 || is_found_[before] == 0 || is_found_[after] == 0) continue;
    found_[i] = 0.5f * (found_[before] + found_[after]);
    is_found_[i] = 1;
  }
}

void EdgeRefiner::put(const cv::Mat3f& floor, const Eigen::Vector2f& p, const Eigen::Vector2f& along,
                      std::uint8_t beside, int lane) {
  edges_.x_px[lane] = p.x();
  edges_.y_px[lane] = p.y();
  edges_.along_x[lane] = along.x();
  edges_.along_y[lane] = along.y();
  edges_.beside[lane] = beside;
  const int cx = std::clamp(static_cast<int>(p.x() + 0.5f) / FloorView::kCell, 0, floor.cols - 1);
  const int cy = std::clamp(static_cast<int>(p.y() + 0.5f) / FloorView::kCell, 0, floor.rows - 1);
  for (int c = 0; c < 3; ++c) edges_.floor[c][lane] = floor(cy, cx)[c];
}

/// Lanes beyond `count` hold older points. Returns 0, the number of points that remain in the lanes.
int EdgeRefiner::takeEdges(const ContourFrame& frame, const std::size_t* which, int count) {
  ground::findEdges(frame, options_, edges_);
  for (int k = 0; k < count; ++k) {
    if (edges_.found[k] == 0) continue;
    found_[which[k]] = {edges_.x_px[k], edges_.y_px[k]};
    is_found_[which[k]] = 1;
  }
  return 0;
}

void EdgeRefiner::smooth() {
  // Savitzky–Golay filter, second order over seven points. It keeps straight lines and curvature and halves
  // the noise.
  static constexpr float kWeight[7] = {-2.0f / 21, 3.0f / 21, 6.0f / 21, 7.0f / 21,
                                       6.0f / 21,  3.0f / 21, -2.0f / 21};
  const std::size_t n = found_.size();
  std::size_t row = 0;  // number of consecutive points with an edge, up to i + 3
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
    if (turn < kMinTurn || is_found_[i] == 0) continue;  // only convex corners affect the hull
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
