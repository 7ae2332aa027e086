#include "ground/patch_sums.h"

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kChannels = 3, kChunk = 32;

OMNIFLEET_WIDE void sumColumns(const std::uint8_t* top, std::size_t step, int count, std::uint16_t* out) {
  const std::uint8_t *b = top + step, *c = b + step, *d = c + step, *e = d + step;
  inChunks<kChunk>(
      0, count, [=](int i) __attribute__((always_inline)) {
        out[i] = static_cast<std::uint16_t>(top[i] + b[i] + c[i] + d[i] + e[i]);
      });
}

OMNIFLEET_WIDE void sumAlong(const std::uint16_t* columns, int count, std::uint16_t* out) {
  inChunks<kChunk>(
      0, count, [=](int i) __attribute__((always_inline)) {
        const std::uint16_t* from = columns + i;
        out[i] = static_cast<std::uint16_t>(from[0] + from[kChannels] + from[2 * kChannels] +
                                            from[3 * kChannels] + from[4 * kChannels]);
      });
}

}  // namespace

PatchSums::PatchSums(cv::Size image)
    : sums_(image, cv::Vec<std::uint16_t, 3>(0, 0, 0)),
      column_(static_cast<std::size_t>(kChannels * image.width)) {}

void PatchSums::read(const cv::Mat& image, const cv::Rect& rect) {
  for (int y = rect.y; y < rect.y + rect.height; ++y) {
    const std::uint8_t* top = image.ptr(y - kRadius_px) + kChannels * (rect.x - kRadius_px);
    sumColumns(top, image.step[0], kChannels * (rect.width + 2 * kRadius_px), column_.data());
    sumAlong(column_.data(), kChannels * rect.width, sums_.ptr<std::uint16_t>(y) + kChannels * rect.x);
  }
}

}  // namespace omnifleet::ground
