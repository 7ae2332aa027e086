#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>

#include "ground/floor_view.h"

namespace omnifleet::ground {

inline constexpr int kCopyRow = 16;  // bytes per row of a copied cell; cell tests may read all of them

/// Averages each pixel of a cell over its 3×3 neighbourhood. Output rows are kCopyRow bytes long. At the
/// image border the outermost pixels are replicated.
/// @param image CV_8UC(kChannels) @param x, y first pixel of the cell
template <int kChannels>
void smoothCell(const cv::Mat& image, int x, int y, std::uint8_t* smoothed) {
  constexpr int kRow = (FloorView::kCell + 2) * kChannels;
  const int left = std::clamp(x - 1, 0, image.cols - FloorView::kCell - 2),
            shift = (x - 1 - left) * kChannels;
  const auto rowAt = [&](int k) {
    return image.ptr(std::clamp(y + k, 0, image.rows - 1)) + left * kChannels;
  };
  for (int j = 0; j < FloorView::kCell; ++j) {
    const std::uint8_t *above = rowAt(j - 1), *here = rowAt(j), *below = rowAt(j + 1);
    std::uint16_t sums[kRow];
    for (int i = 0; i < kRow; ++i) sums[i] = static_cast<std::uint16_t>(above[i] + here[i] + below[i]);
    std::uint8_t* out = smoothed + j * kCopyRow;
    const auto mean = [](int sum) {
      return static_cast<std::uint8_t>(static_cast<std::uint16_t>(sum + 4) / 9);
    };
    if (shift == 0) {
      for (int i = 0; i < FloorView::kCell * kChannels; ++i)
        out[i] = mean(sums[i] + sums[i + kChannels] + sums[i + 2 * kChannels]);
      continue;
    }
    for (int i = 0; i < FloorView::kCell * kChannels;
         ++i) {  // beyond the image border its last column is replicated
      const int channel = i % kChannels, last = kRow - kChannels + channel;
      int sum = 0;
      for (int k = 0; k < 3; ++k) sum += sums[std::clamp(i + shift + k * kChannels, channel, last)];
      out[i] = mean(sum);
    }
  }
}

}  // namespace omnifleet::ground
