#include "ground/strip_joins.h"

#include <algorithm>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

struct Largest {
  static std::uint8_t of(std::uint8_t a, std::uint8_t b) { return a > b ? a : b; }
};
struct Smallest {
  static std::uint8_t of(std::uint8_t a, std::uint8_t b) { return a < b ? a : b; }
};

/// `step`: from a pixel to its neighbour.
template <int kRadius, typename Join>
inline __attribute__((always_inline)) void joinStrips(const Strip* strips, std::size_t count, cv::Size size,
                                                      std::ptrdiff_t step, const std::uint8_t* in,
                                                      std::uint8_t* out, std::ptrdiff_t row_step) {
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = std::max(strip->begin_px, kRadius), end = std::min(strip->end_px, size.width - kRadius);
    const int top = std::max(strip->cell_row * FloorView::kCell, kRadius);
    const int bottom = std::min((strip->cell_row + 1) * FloorView::kCell, size.height - kRadius);
    for (int y = top; y < bottom; ++y) {
      const std::uint8_t* from = in + y * row_step;
      std::uint8_t* to = out + y * row_step;
#pragma GCC ivdep
      for (int x = begin; x < end; ++x) {
        std::uint8_t value = from[x];
        for (int k = 1; k <= kRadius; ++k)
          value = Join::of(value, Join::of(from[x - k * step], from[x + k * step]));
        to[x] = value;
      }
    }
  }
}

template <typename Join>
inline __attribute__((always_inline)) void joinAnyRadius(int radius, const Strip* strips, std::size_t count,
                                                         cv::Size size, std::ptrdiff_t step,
                                                         const std::uint8_t* in, std::uint8_t* out,
                                                         std::ptrdiff_t row_step) {
  switch (radius) {
    case 1:
      return joinStrips<1, Join>(strips, count, size, step, in, out, row_step);
    case 2:
      return joinStrips<2, Join>(strips, count, size, step, in, out, row_step);
    case 3:
      return joinStrips<3, Join>(strips, count, size, step, in, out, row_step);
    case 4:
      return joinStrips<4, Join>(strips, count, size, step, in, out, row_step);
    case 5:
      return joinStrips<5, Join>(strips, count, size, step, in, out, row_step);
    case 6:
      return joinStrips<6, Join>(strips, count, size, step, in, out, row_step);
    case 7:
      return joinStrips<7, Join>(strips, count, size, step, in, out, row_step);
    default:
      return joinStrips<kMaxJoin, Join>(strips, count, size, step, in, out, row_step);
  }
}

OMNIFLEET_WIDE void joinLargest(int radius, const Strip* strips, std::size_t count, cv::Size size,
                                std::ptrdiff_t step, const std::uint8_t* in, std::uint8_t* out,
                                std::ptrdiff_t row_step) {
  joinAnyRadius<Largest>(radius, strips, count, size, step, in, out, row_step);
}

OMNIFLEET_WIDE void joinSmallest(int radius, const Strip* strips, std::size_t count, cv::Size size,
                                 std::ptrdiff_t step, const std::uint8_t* in, std::uint8_t* out,
                                 std::ptrdiff_t row_step) {
  joinAnyRadius<Smallest>(radius, strips, count, size, step, in, out, row_step);
}

}  // namespace

void largestAlong(Along along, int radius, const std::vector<Strip>& strips, const cv::Mat1b& in,
                  cv::Mat1b& out) {
  const auto row_step = static_cast<std::ptrdiff_t>(in.step1());
  joinLargest(radius, strips.data(), strips.size(), in.size(), along == Along::kRows ? 1 : row_step, in.data,
              out.data, row_step);
}

void smallestAlong(Along along, int radius, const std::vector<Strip>& strips, const cv::Mat1b& in,
                   cv::Mat1b& out) {
  const auto row_step = static_cast<std::ptrdiff_t>(in.step1());
  joinSmallest(radius, strips.data(), strips.size(), in.size(), along == Along::kRows ? 1 : row_step, in.data,
               out.data, row_step);
}

}  // namespace omnifleet::ground
