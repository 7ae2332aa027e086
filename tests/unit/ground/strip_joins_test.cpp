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

TEST(StripJoins, AreDilationAndErosionByLinesOnTheStripsAndNothingElsewhere) {
  const cv::Size size(96, 64);
  cv::Mat1b image(size);
  cv::RNG random(3);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  const std::vector<Strip> strips = {{0, 0, 96}, {3, 16, 48}, {3, 64, 96}, {4, 32, 80}, {15, 0, 96}};
  for (int radius = 1; radius <= kMaxJoin; ++radius) {
    for (const Along along : {Along::kRows, Along::kColumns}) {
      const int length = 2 * radius + 1;
      const cv::Mat line(along == Along::kRows ? cv::Size(length, 1) : cv::Size(1, length), CV_8U, 1.0);
      cv::Mat1b largest, smallest;
      cv::dilate(image, largest, line);
      cv::erode(image, smallest, line);
      const cv::Mat1b where = defined(strips, radius, size);
      constexpr std::uint8_t kUntouched = 77;
      largest.setTo(kUntouched, ~where);
      smallest.setTo(kUntouched, ~where);
      cv::Mat1b out(size, kUntouched);
      largestAlong(along, radius, strips, image, out);
      EXPECT_EQ(cv::countNonZero(out != largest), 0) << radius;
      out.setTo(kUntouched);
      smallestAlong(along, radius, strips, image, out);
      EXPECT_EQ(cv::countNonZero(out != smallest), 0) << radius;
    }
  }
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
