#include "ground/strip_joins.h"

#include "ground/strip_kernels.h"

namespace omnifleet::ground {

namespace {

template <typename Join, int kRadius>
struct JoinKernel {
  const std::uint8_t* in;
  std::uint8_t* out;
  std::ptrdiff_t step;

  template <int kRows, int kColumns>
  OMNIFLEET_INLINE void run(std::ptrdiff_t at) const {
    std::uint8_t joined[kRows][kColumns];
    joinSquares<Join, kRadius>(in + at, step, joined);
    for (int y = 0; y < kRows; ++y) std::memcpy(out + at + y * step, joined[y], kColumns);
  }
};

struct GrowKernel {
  const std::uint8_t *in, *within;
  std::uint8_t* out;
  std::ptrdiff_t step;

  template <int kRows, int kColumns>
  OMNIFLEET_INLINE void run(std::ptrdiff_t at) const {
    std::uint8_t grown[kRows][kColumns];
    joinSquares<Largest, 1>(in + at, step, grown);
    for (int y = 0; y < kRows; ++y) {
      for (int x = 0; x < kColumns; ++x)
        grown[y][x] = static_cast<std::uint8_t>(grown[y][x] & within[at + y * step + x]);
      std::memcpy(out + at + y * step, grown[y], kColumns);
    }
  }
};

template <typename Join>
OMNIFLEET_INLINE void joinAnyRadius(int radius, const Strip* strips, std::size_t count,
                                    const MaskLayout& layout, const std::uint8_t* in, std::uint8_t* out) {
  const std::ptrdiff_t step = layout.step;
  switch (radius) {
    case 1:
      return overStrips(strips, count, layout, 1, JoinKernel<Join, 1>{in, out, step});
    case 2:
      return overStrips(strips, count, layout, 2, JoinKernel<Join, 2>{in, out, step});
    case 3:
      return overStrips(strips, count, layout, 3, JoinKernel<Join, 3>{in, out, step});
    case 4:
      return overStrips(strips, count, layout, 4, JoinKernel<Join, 4>{in, out, step});
    case 5:
      return overStrips(strips, count, layout, 5, JoinKernel<Join, 5>{in, out, step});
    case 6:
      return overStrips(strips, count, layout, 6, JoinKernel<Join, 6>{in, out, step});
    case 7:
      return overStrips(strips, count, layout, 7, JoinKernel<Join, 7>{in, out, step});
    default:
      return overStrips(strips, count, layout, kMaxJoin, JoinKernel<Join, kMaxJoin>{in, out, step});
  }
}

OMNIFLEET_WIDE void joinLargest(int radius, const Strip* strips, std::size_t count, const MaskLayout& layout,
                                const std::uint8_t* in, std::uint8_t* out) {
  joinAnyRadius<Largest>(radius, strips, count, layout, in, out);
}

OMNIFLEET_WIDE void joinSmallest(int radius, const Strip* strips, std::size_t count, const MaskLayout& layout,
                                 const std::uint8_t* in, std::uint8_t* out) {
  joinAnyRadius<Smallest>(radius, strips, count, layout, in, out);
}

OMNIFLEET_WIDE void grow(const Strip* strips, std::size_t count, const MaskLayout& layout,
                         const std::uint8_t* in, const std::uint8_t* within, std::uint8_t* out) {
  overStrips(strips, count, layout, 1, GrowKernel{in, within, out, layout.step});
}

}  // namespace

void largestAround(int radius, const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out) {
  joinLargest(radius, strips.data(), strips.size(), MaskLayout(in), in.data, out.data);
}

void smallestAround(int radius, const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out) {
  joinSmallest(radius, strips.data(), strips.size(), MaskLayout(in), in.data, out.data);
}

void growWithin(const std::vector<Strip>& strips, const cv::Mat1b& in, const cv::Mat1b& within,
                cv::Mat1b& out) {
  grow(strips.data(), strips.size(), MaskLayout(in), in.data, within.data, out.data);
}

}  // namespace omnifleet::ground
