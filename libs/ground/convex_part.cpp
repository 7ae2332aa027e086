#include "ground/convex_part.h"

#include <algorithm>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"
#include "ground/strip_kernels.h"

namespace omnifleet::ground {

namespace {

constexpr int kChunk_px = 32;
constexpr std::uint8_t kSet = 255;

/// out[x] = Join of 2·radius + 1 values at distance `step`; the middle one is from[x].
template <typename Join>
OMNIFLEET_INLINE void join(const std::uint8_t* from, std::ptrdiff_t step, int radius, int begin, int end,
                           std::uint8_t* out) {
  const std::ptrdiff_t outer = radius * step;
  inChunks<kChunk_px>(
      begin, end, [=](int x) __attribute__((always_inline)) {
        const std::uint8_t* at = from + x;
        out[x] = Join::of(Join::of(Join::of(at[-outer], at[-step]), Join::of(at[step], at[outer])), *at);
      });
}
OMNIFLEET_WIDE void smallest(const std::uint8_t* from, std::ptrdiff_t step, int radius, int begin, int end,
                             std::uint8_t* out) {
  join<Smallest>(from, step, radius, begin, end, out);
}
OMNIFLEET_WIDE void largest(const std::uint8_t* from, std::ptrdiff_t step, int radius, int begin, int end,
                            std::uint8_t* out) {
  join<Largest>(from, step, radius, begin, end, out);
}

/// Number of pixels inside a polygon or on its edge (Pick 1899).
double pixelsOf(const std::vector<cv::Point>& polygon) {
  int on_edge = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const cv::Point along = polygon[(i + 1) % polygon.size()] - polygon[i];
    on_edge += std::gcd(along.x, along.y);
  }
  return cv::contourArea(polygon) + 0.5 * on_edge + 1.0;
}

}  // namespace

ConvexPart::ConvexPart(cv::Size image, int radius_px)
    : radius_px_(radius_px),
      along_(image, std::uint8_t{0}),
      eroded_(image, std::uint8_t{0}),
      firm_(image, std::uint8_t{0}) {}

bool ConvexPart::find(const cv::Mat1b& mask, const cv::Rect& within, double min_solid) {
  open(mask, within);
  largest_.clear();
  for (int y = within.y; y < within.y + within.height; ++y) {
    for (int x = within.x; x < within.x + within.width; ++x) {
      if (firm_(y, x) != kSet) continue;
      flood({x, y}, within);
      if (queue_.size() > largest_.size()) largest_.swap(queue_);
    }
  }
  if (largest_.empty()) return false;
  measureRows(within);
  cv::convexHull(corners_, hull_);
  return filledArea() >= min_solid * pixelsOf(hull_);
}

void ConvexPart::measureRows(const cv::Rect& within) {
  rows_.assign(static_cast<std::size_t>(within.height), {within.width, -1});
  columns_.assign(static_cast<std::size_t>(within.width), {within.height, -1});
  for (const cv::Point& pixel : largest_) {
    const cv::Point at = pixel - within.tl();
    rows_[static_cast<std::size_t>(at.y)].take(at.x);
    columns_[static_cast<std::size_t>(at.x)].take(at.y);
  }
  corners_.clear();
  for (int y = 0; y < within.height; ++y) {
    const Extent& row = rows_[static_cast<std::size_t>(y)];
    if (row.last < 0) continue;
    corners_.push_back(within.tl() + cv::Point(row.first, y));
    corners_.push_back(within.tl() + cv::Point(row.last, y));
  }
}

/// Pixels of the largest part including its holes. A hole pixel has pixels of the part to the left, to the
/// right, above and below.
int ConvexPart::filledArea() const {
  int area = 0;
  for (std::size_t y = 0; y < rows_.size(); ++y) {
    for (int x = rows_[y].first; x <= rows_[y].last; ++x) {
      const Extent& column = columns_[static_cast<std::size_t>(x)];
      area += column.first <= static_cast<int>(y) && static_cast<int>(y) <= column.last ? 1 : 0;
    }
  }
  return area;
}

/// Morphological opening. Pixels closer to the rectangle's edges than the radius are removed.
void ConvexPart::open(const cv::Mat1b& mask, const cv::Rect& within) {
  const int left = within.x, right = within.x + within.width, top = within.y, bottom = top + within.height;
  const auto step = static_cast<std::ptrdiff_t>(along_.step1());
  for (cv::Mat1b* cleared : {&along_, &eroded_, &firm_})
    for (int y = top; y < bottom; ++y)
      std::fill(cleared->ptr(y) + left, cleared->ptr(y) + right, std::uint8_t{0});
  const int first = left + radius_px_, end = right - radius_px_;
  if (first >= end) return;
  for (int y = top; y < bottom; ++y) smallest(mask.ptr(y), 1, radius_px_, first, end, along_.ptr(y));
  for (int y = top + radius_px_; y < bottom - radius_px_; ++y)
    smallest(along_.ptr(y), step, radius_px_, first, end, eroded_.ptr(y));
  for (int y = top; y < bottom; ++y) largest(eroded_.ptr(y), 1, radius_px_, first, end, along_.ptr(y));
  for (int y = top + radius_px_; y < bottom - radius_px_; ++y)
    largest(along_.ptr(y), step, radius_px_, first, end, firm_.ptr(y));
}

/// Moves the connected component of the seed from the mask to queue_.
void ConvexPart::flood(const cv::Point& seed, const cv::Rect& within) {
  queue_.assign(1, seed);
  firm_(seed) = 0;
  for (std::size_t i = 0; i < queue_.size(); ++i) {
    for (const cv::Point& step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point next = queue_[i] + step;
      if (!within.contains(next) || firm_(next) != kSet) continue;
      firm_(next) = 0;
      queue_.push_back(next);
    }
  }
}

}  // namespace omnifleet::ground
