#include "flow/pyramid.h"

#include <array>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::flow {

namespace {

constexpr int kMargin = 1;  // entries beside a row's even and odd pixels, for those beyond the border

/// The border's pixels come again behind it, without the outermost (BORDER_REFLECT_101).
int mirrored(int i, int size) {
  return i < 0 ? -i : i >= size ? 2 * size - 2 - i : i;
}

/// Pixels 2x to `even`, 2x + 1 to `odd`, x from −1 to one behind the last.
OMNIFLEET_WIDE void splitRow(const std::uint8_t* in, int width, std::uint8_t* even, std::uint8_t* odd) {
  const int pairs = width / 2, half = (width + 1) / 2;
#pragma GCC ivdep
  for (int x = 0; x < pairs; ++x) {
    even[x] = in[2 * x];
    odd[x] = in[2 * x + 1];
  }
  if (half > pairs) even[pairs] = in[width - 1];
  odd[-1] = odd[0];
  even[-1] = in[2];
  odd[pairs] = in[mirrored(2 * pairs + 1, width)];
  even[half] = in[mirrored(2 * half, width)];
}

/// 1 4 6 4 1 along the row, at every other pixel.
OMNIFLEET_WIDE void smoothRow(const std::uint8_t* even, const std::uint8_t* odd, int half,
                              std::uint16_t* out) {
#pragma GCC ivdep
  for (int x = 0; x < half; ++x) {
    out[x] = static_cast<std::uint16_t>(even[x - 1] + even[x + 1] + 4 * (odd[x - 1] + odd[x]) + 6 * even[x]);
  }
}

/// The same over five such rows; the sum of all weights is 256.
OMNIFLEET_WIDE void smoothColumns(const std::array<const std::uint16_t*, 5>& rows, int half,
                                  std::uint8_t* out) {
  const std::uint16_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
#pragma GCC ivdep
  for (int x = 0; x < half; ++x) {
    const auto sum = static_cast<std::uint16_t>(a[x] + e[x] + 4 * (b[x] + d[x]) + 6 * c[x] + 128);
    out[x] = static_cast<std::uint8_t>(sum >> 8);
  }
}

}  // namespace

void Pyramid::build(const cv::Mat& image) {
  if (image.channels() == 3)
    cv::cvtColor(image, levels_[0], cv::COLOR_BGR2GRAY);
  else
    image.copyTo(levels_[0]);
  build();
}

void Pyramid::build() {
  for (std::size_t k = 1; k < levels_.size(); ++k) halve(levels_[k - 1], levels_[k]);
}

void Pyramid::halve(const cv::Mat1b& fine, cv::Mat1b& coarse) {
  if (fine.cols < 4 || fine.rows < 4) {
    cv::pyrDown(fine, coarse);
    return;
  }
  coarse.create((fine.rows + 1) / 2, (fine.cols + 1) / 2);
  const int half = coarse.cols;
  even_.resize(static_cast<std::size_t>(half + 2 * kMargin));
  odd_.resize(even_.size());
  rows_.resize(static_cast<std::size_t>(5 * half));
  const auto smoothed = [&](int y) { return rows_.data() + y % 5 * half; };
  int next = 0;  // first row that is not smoothed yet
  for (int y = 0; y < coarse.rows; ++y) {
    for (; next <= std::min(2 * y + 2, fine.rows - 1); ++next) {
      splitRow(fine.ptr(next), fine.cols, even_.data() + kMargin, odd_.data() + kMargin);
      smoothRow(even_.data() + kMargin, odd_.data() + kMargin, half, smoothed(next));
    }
    std::array<const std::uint16_t*, 5> rows{};
    for (int k = 0; k < 5; ++k)
      rows[static_cast<std::size_t>(k)] = smoothed(mirrored(2 * y + k - 2, fine.rows));
    smoothColumns(rows, half, coarse.ptr(y));
  }
}

}  // namespace omnifleet::flow
