#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace omnifleet::appearance {

struct PixelSample {
  std::uint16_t x, y;
};

/// Columns of a block of the panorama. Samples are listed block by block, within a block row by row:
/// neighbouring cells then use the same lines of the cache.
inline constexpr int kBlockColumns = 16;

/// Each cell of the panorama becomes the mean grey level (ITU-R BT.601) of its `per_cell` samples (at most
/// 64).
/// @param image CV_8UC1 or CV_8UC3 (BGR); all samples must lie in it, none in its last pixel, because four
/// bytes are read at once @param panorama its columns are a multiple of kBlockColumns
void averagePixels(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama);

}  // namespace omnifleet::appearance
