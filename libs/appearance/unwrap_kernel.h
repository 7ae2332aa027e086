#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace omnifleet::appearance {

struct PixelSample {
  std::uint16_t x, y;
};

/// Each cell of the panorama, in row order, becomes the mean grey level (ITU-R BT.601) of its `per_cell`
/// samples (at most 64). @param image CV_8UC1 or CV_8UC3 (BGR); all samples must lie in it.
void averagePixels(const cv::Mat& image, const PixelSample* samples, int per_cell, cv::Mat1b& panorama);

}  // namespace omnifleet::appearance
