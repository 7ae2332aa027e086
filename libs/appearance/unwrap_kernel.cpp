#include "appearance/unwrap_kernel.h"

#include <cstring>

#include "geometry/wide.h"

namespace omnifleet::appearance {
namespace {

// BT.601 luma in units of 1/256.
constexpr unsigned kBlue = 29, kGreen = 150, kRed = 77;
constexpr int kShift = 24;
constexpr int kAhead = 96;  // samples, prefetched so that the frame's lines arrive in time

/// Sums of samples become grey levels by a multiplication: 2^24 / (256·per_cell), rounded.
struct Scale {
  std::uint64_t factor;
  explicit Scale(int per_cell)
      : factor(((1u << kShift) / 256u + static_cast<unsigned>(per_cell) / 2u) /
               static_cast<unsigned>(per_cell)) {}
  OMNIFLEET_INLINE std::uint8_t operator()(std::uint64_t sum) const {
    return static_cast<std::uint8_t>((sum * factor + (1u << (kShift - 1))) >> kShift);
  }
};

/// 256 times the sum of the grey levels of `count` pixels.
template <int kChannels>
OMNIFLEET_INLINE unsigned sumPixels(const std::uint8_t* image, std::size_t step, const PixelSample* samples,
                                    int count) {
  unsigned red_blue = 0, green = 0;
  for (int k = 0; k < count; ++k) {
    const std::uint8_t* pixel =
        image + samples[k].y * step + static_cast<std::size_t>(kChannels) * samples[k].x;
    if constexpr (kChannels == 1) {
      green += *pixel;
    } else {
      std::uint32_t colours;
      std::memcpy(&colours, pixel, sizeof colours);
      red_blue += colours & 0xff00ffU;
      green += (colours >> 8) & 0xffU;
    }
  }
  if constexpr (kChannels == 1) return 256u * green;
  return kBlue * (red_blue & 0xffffU) + kGreen * green + kRed * (red_blue >> 16);
}

template <int kChannels, int kPerCell>
void average(const cv::Mat& image, const PixelSample* samples, int any_count, cv::Mat1b& panorama) {
  const int per_cell = kPerCell > 0 ? kPerCell : any_count;
  const Scale scale(per_cell);
  const std::uint8_t* const pixels = image.data;
  const std::size_t step = image.step;
  const PixelSample* const end = samples + static_cast<std::ptrdiff_t>(panorama.total()) * per_cell;
  for (int begin = 0; begin < panorama.cols; begin += kBlockColumns) {
    for (int row = 0; row < panorama.rows; ++row) {
      std::uint8_t* out = panorama[row] + begin;
      for (int c = 0; c < kBlockColumns; ++c) {
        if (samples + kAhead < end) {
          const PixelSample& next = samples[kAhead];
          __builtin_prefetch(pixels + next.y * step + static_cast<std::size_t>(kChannels) * next.x);
        }
        out[c] = scale(sumPixels<kChannels>(pixels, step, samples, per_cell));
        samples += per_cell;
      }
    }
  }
}

template <int kChannels>
void averageBy(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama) {
  switch (per_cell) {
    case 1:
      return average<kChannels, 1>(image, samples, 1, panorama);
    case 2:
      return average<kChannels, 2>(image, samples, 2, panorama);
    case 4:
      return average<kChannels, 4>(image, samples, 4, panorama);
    default:
      return average<kChannels, 0>(image, samples, per_cell, panorama);
  }
}

}  // namespace

void averagePixels(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama) {
  if (image.channels() == 3)
    averageBy<3>(image, samples, per_cell, panorama);
  else
    averageBy<1>(image, samples, per_cell, panorama);
}

}  // namespace omnifleet::appearance
