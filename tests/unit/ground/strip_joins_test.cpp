// Joins on strips against OpenCV's dilation and erosion.

#include "ground/strip_joins.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {
namespace {

/// Zero where the image's edge or the strips' leave a join undefined.
cv::Mat1b defined(const std::vector<Strip>& strips, int radius, cv::Size size) {
  cv::Mat1b where(size, std::uint8_t{0});
  for (const Strip& s : strips)
    where(cv::Rect(s.begin_px, s.cell_row * FloorView::kCell, s.end_px - s.begin_px, FloorView::kCell))
        .setTo(255);
  cv::Mat1b inner(size, std::uint8_t{0});
  inner(cv::Rect(radius, radius, size.width - 2 * radius, size.height - 2 * radius)).setTo(255);
  return where & inner;
}

constexpr std::uint8_t kUntouched = 77;

struct Noise {
  cv::Size size{96, 64};
  cv::Mat1b image{size};
  std::vector<Strip> strips = {{0, 0, 96}, {3, 16, 48}, {3, 64, 96}, {4, 32, 80}, {7, 48, 64}, {15, 0, 96}};
  Noise() { cv::RNG(3).fill(image, cv::RNG::UNIFORM, 0, 256); }
};

TEST(StripJoins, AreDilationAndErosionBySquaresOnTheStripsAndNothingElsewhere) {
  const Noise noise;
  for (int radius = 1; radius <= kMaxJoin; ++radius) {
    const cv::Mat square(2 * radius + 1, 2 * radius + 1, CV_8U, 1.0);
    cv::Mat1b largest, smallest;
    cv::dilate(noise.image, largest, square);
    cv::erode(noise.image, smallest, square);
    const cv::Mat1b where = defined(noise.strips, radius, noise.size);
    largest.setTo(kUntouched, ~where);
    smallest.setTo(kUntouched, ~where);
    cv::Mat1b out(noise.size, kUntouched);
    largestAround(radius, noise.strips, noise.image, out);
    EXPECT_EQ(cv::countNonZero(out != largest), 0) << radius;
    out.setTo(kUntouched);
    smallestAround(radius, noise.strips, noise.image, out);
    EXPECT_EQ(cv::countNonZero(out != smallest), 0) << radius;
  }
}

TEST(StripJoins, GrowsByOnePixelWithinAMaskEvenOntoTheMaskItself) {
  const Noise noise;
  cv::Mat1b core = noise.image > 240, within = noise.image > 120, expected;
  cv::dilate(core, expected, cv::Mat(3, 3, CV_8U, 1.0));
  expected &= within;
  const cv::Mat1b where = defined(noise.strips, 1, noise.size);
  cv::Mat1b out(noise.size, kUntouched);
  growWithin(noise.strips, core, within, out);
  EXPECT_EQ(cv::countNonZero((out != expected) & where), 0);
  EXPECT_EQ(cv::countNonZero((out != kUntouched) & ~where), 0);
  growWithin(noise.strips, core, within, within);
  EXPECT_EQ(cv::countNonZero((within != expected) & where), 0);
}

TEST(StripJoins, ClearedStripsAreZeroAndNothingElseIs) {
  cv::Mat1b mask(32, 64, std::uint8_t{9});
  clearStrips({{1, 16, 48}, {5, 0, 16}}, mask);
  EXPECT_EQ(cv::countNonZero(mask == 0), (32 + 16) * FloorView::kCell);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(16, 4, 32, 4))), 0);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(0, 20, 16, 4))), 0);
}

}  // namespace
}  // namespace omnifleet::ground
