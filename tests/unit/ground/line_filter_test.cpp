#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ground/line_filter.h"
#include "tests/unit/ground/bits.h"

namespace omnifleet::ground {
namespace {

cv::Mat1b filtered(const cv::Mat1b& mask, LineFilter& filter) {
  testing::Bits bits(mask);
  filter.apply(bits.area, bits.mask);
  return testing::Bits::bytesOf(bits.mask);
}

TEST(LineFilter, RemovesGridAndKeepsBoxOnIt) {
  cv::Mat1b mask(240, 320, std::uint8_t{0});
  for (int k = 20; k < 320; k += 40) cv::line(mask, {k, 10}, {k + 9, 230}, 255, 3);
  for (int k = 20; k < 240; k += 40) cv::line(mask, {10, k}, {310, k + 7}, 255, 3);
  cv::Mat1b box(mask.size(), std::uint8_t{0});
  const std::vector<cv::Point> corners = {{100, 90}, {150, 105}, {135, 160}, {85, 145}};
  cv::fillConvexPoly(box, corners, 255);
  mask |= box;
  LineFilter filter(mask.size(), 7);
  mask = filtered(mask, filter);
  EXPECT_EQ(cv::countNonZero(box & ~mask), 0);  // the corners too
  cv::Mat1b near_box;
  cv::dilate(box, near_box, cv::getStructuringElement(cv::MORPH_RECT, {15, 15}));
  // Stubs of lines may remain: half the width grows back. Where a line leaves at an acute angle, the square
  // fits up to the same distance farther out.
  EXPECT_EQ(cv::countNonZero(mask & ~near_box), 0);
}

TEST(LineFilter, EqualsOpeningIfNothingGrowsBack) {
  cv::Mat1b mask(120, 160, std::uint8_t{0});
  mask(cv::Rect(40, 40, 20, 30)).setTo(255);
  mask(cv::Rect(80, 40, 4, 30)).setTo(255);
  cv::Mat1b opened;
  cv::morphologyEx(mask, opened, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  LineFilter filter(mask.size(), 5);
  EXPECT_EQ(cv::countNonZero(filtered(mask, filter) != opened), 0);
  // The buffers keep nothing from the previous call.
  EXPECT_EQ(cv::countNonZero(filtered(mask, filter) != opened), 0);
}

TEST(LineFilter, ChangesNothingAtWidthOne) {
  cv::Mat1b mask(40, 40, std::uint8_t{0});
  mask(20, 20) = 255;
  LineFilter filter(mask.size(), 1);
  EXPECT_EQ(cv::countNonZero(filtered(mask, filter)), 1);
}

}  // namespace
}  // namespace omnifleet::ground
