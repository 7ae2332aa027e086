#include "distance_vector/smoothed_image.h"

#include <algorithm>

#include "geometry/wide.h"

namespace omnifleet::distance_vector {
namespace {

/// One row, smoothed along u, in three planes; weights 1 2 1. The border pixels repeat.
OMNIFLEET_WIDE void smoothAlong(const std::uint8_t* bgr, int width, std::uint16_t* b, std::uint16_t* g,
                                std::uint16_t* r) {
#pragma GCC ivdep
  for (int u = 1; u < width - 1; ++u) {
    const std::uint8_t* p = bgr + 3 * u;
    b[u] = static_cast<std::uint16_t>(p[-3] + 2 * p[0] + p[3]);
    g[u] = static_cast<std::uint16_t>(p[-2] + 2 * p[1] + p[4]);
    r[u] = static_cast<std::uint16_t>(p[-1] + 2 * p[2] + p[5]);
  }
  const std::uint8_t* last = bgr + 3 * (width - 1);
  b[0] = static_cast<std::uint16_t>(3 * bgr[0] + bgr[3]);
  g[0] = static_cast<std::uint16_t>(3 * bgr[1] + bgr[4]);
  r[0] = static_cast<std::uint16_t>(3 * bgr[2] + bgr[5]);
  b[width - 1] = static_cast<std::uint16_t>(last[-3] + 3 * last[0]);
  g[width - 1] = static_cast<std::uint16_t>(last[-2] + 3 * last[1]);
  r[width - 1] = static_cast<std::uint16_t>(last[-1] + 3 * last[2]);
}

OMNIFLEET_WIDE void smoothDown(const std::uint16_t* above, const std::uint16_t* middle,
                               const std::uint16_t* below, int width, std::uint16_t* out) {
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) out[u] = static_cast<std::uint16_t>(above[u] + 2 * middle[u] + below[u]);
}

}  // namespace

void SmoothedImage::compute(const cv::Mat& bgr) {
  size_ = bgr.size();
  const int width = size_.width, height = size_.height;
  const auto stride = static_cast<std::size_t>(width);
  for (int c = 0; c < 3; ++c) {
    planes_[c].resize(stride * static_cast<std::size_t>(height));
    across_[c].resize(stride * 3);
  }
  const auto ring = [&](int c, int v) {
    return across_[c].data() + static_cast<std::size_t>(v % 3) * stride;
  };
  for (int v = 0; v <= height; ++v) {
    if (v < height) smoothAlong(bgr.ptr<std::uint8_t>(v), width, ring(0, v), ring(1, v), ring(2, v));
    if (v == 0) continue;
    const int out = v - 1, above = std::max(0, out - 1), below = std::min(height - 1, out + 1);
    for (int c = 0; c < 3; ++c)
      smoothDown(ring(c, above), ring(c, out), ring(c, below), width,
                 planes_[c].data() + static_cast<std::size_t>(out) * stride);
  }
}

}  // namespace omnifleet::distance_vector
