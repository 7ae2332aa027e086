#include "appearance/unwrap_kernel.h"

#include "geometry/wide.h"

namespace omnifleet::appearance {
namespace {

// BT.601 luma in units of 1/256.
constexpr unsigned kBlue = 29, kGreen = 150, kRed = 77;
constexpr int kShift = 24;

/// Sums of samples become grey levels by a multiplication: 2^24 / (256·per_cell), rounded.
struct Scale {
  std::uint64_t factor;
  explicit Scale(int per_cell) : factor(((1u << kShift) / 256u + per_cell / 2u) / per_cell) {}
  OMNIFLEET_INLINE std::uint8_t operator()(std::uint64_t sum) const {
    return static_cast<std::uint8_t>((sum * factor + (1u << (kShift - 1))) >> kShift);
  }
};

template <int kPerCell>
OMNIFLEET_INLINE void averageBgr(const std::uint8_t* image, std::size_t step, const PixelSample* samples,
                                 int any_count, int cells, std::uint8_t* out) {
  const int per_cell = kPerCell > 0 ? kPerCell : any_count;
  const Scale scale(per_cell);
  for (int cell = 0; cell < cells; ++cell) {
    unsigned blue = 0, green = 0, red = 0;
    for (int k = 0; k < per_cell; ++k) {
      const PixelSample s = *samples++;
      const std::uint8_t* pixel = image + s.y * step + 3u * s.x;
      blue += pixel[0];
      green += pixel[1];
      red += pixel[2];
    }
    out[cell] = scale(kBlue * blue + kGreen * green + kRed * red);
  }
}

template <int kPerCell>
OMNIFLEET_INLINE void averageGrey(const std::uint8_t* image, std::size_t step, const PixelSample* samples,
                                  int any_count, int cells, std::uint8_t* out) {
  const int per_cell = kPerCell > 0 ? kPerCell : any_count;
  const Scale scale(per_cell);
  for (int cell = 0; cell < cells; ++cell) {
    unsigned sum = 0;
    for (int k = 0; k < per_cell; ++k) {
      const PixelSample s = *samples++;
      sum += image[s.y * step + s.x];
    }
    out[cell] = scale(256u * sum);
  }
}

template <int kPerCell>
void average(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama) {
  const int cells = panorama.rows * panorama.cols;
  if (image.channels() == 3)
    averageBgr<kPerCell>(image.data, image.step, samples, per_cell, cells, panorama.data);
  else
    averageGrey<kPerCell>(image.data, image.step, samples, per_cell, cells, panorama.data);
}

}  // namespace

void averagePixels(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama) {
  switch (per_cell) {
    case 1:
      return average<1>(image, samples, 1, panorama);
    case 2:
      return average<2>(image, samples, 2, panorama);
    case 3:
      return average<3>(image, samples, 3, panorama);
    case 4:
      return average<4>(image, samples, 4, panorama);
    default:
      return average<0>(image, samples, per_cell, panorama);
  }
}

}  // namespace omnifleet::appearance
