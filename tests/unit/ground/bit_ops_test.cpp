// Compares the operations on bit masks with OpenCV's on byte masks.

#include "ground/bit_ops.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/unit/ground/bits.h"

namespace omnifleet::ground {
namespace {

using testing::Bits;

/// Noise over several words. The width is no multiple of the word length.
class BitOpsTest : public ::testing::TestWithParam<int> {
 protected:
  BitOpsTest() {
    cv::Mat1b noise(size_);
    cv::RNG(3).fill(noise, cv::RNG::UNIFORM, 0, 256);
    bytes_ = noise < GetParam();
    for (const Strip& s : strips_)
      where_(cv::Rect(s.begin_px, s.cell_row * FloorView::kCell, s.end_px - s.begin_px, FloorView::kCell))
          .setTo(255);
  }
  /// Expects the result of an operation on the strips and unchanged pixels elsewhere.
  template <typename Operation>
  void expect(const cv::Mat1b& expected, Operation operation) const {
    const Bits all(bytes_);
    BitArea area(size_);
    area.cover(strips_);
    for (const std::uint8_t before : {0, 255}) {
      BitMask out = Bits(cv::Mat1b(size_, before)).mask;
      operation(area, all.mask, out);
      const cv::Mat1b got = Bits::bytesOf(out);
      EXPECT_EQ(cv::countNonZero((got != expected) & where_), 0);
      EXPECT_EQ(cv::countNonZero((got != before) & ~where_), 0);
    }
  }

  cv::Size size_{336, 64};
  cv::Mat1b bytes_;
  std::vector<Strip> strips_ = {{0, 0, 336},   {3, 16, 48},   {3, 112, 208},
                                {4, 240, 272}, {7, 304, 336}, {15, 0, 320}};
  cv::Mat1b where_{size_, std::uint8_t{0}};
};

cv::Mat square(int radius) {
  return {2 * radius + 1, 2 * radius + 1, CV_8U, cv::Scalar(1)};
}

TEST_P(BitOpsTest, ErodesAndDilatesBySquares) {
  for (int radius = 1; radius <= kMaxReach; ++radius) {
    cv::Mat1b eroded, dilated;
    const auto border = cv::BORDER_CONSTANT;
    cv::erode(bytes_, eroded, square(radius), {-1, -1}, 1, border, cv::Scalar(0));
    cv::dilate(bytes_, dilated, square(radius), {-1, -1}, 1, border, cv::Scalar(0));
    expect(eroded,
           [&](const BitArea& area, const BitMask& in, BitMask& out) { erode(area, radius, in, out); });
    expect(dilated,
           [&](const BitArea& area, const BitMask& in, BitMask& out) { dilate(area, radius, in, out); });
  }
}

TEST_P(BitOpsTest, TakesMedianOf5x5AndRegrowsCorners) {
  cv::Mat1b framed, median, near;
  cv::copyMakeBorder(bytes_, framed, 4, 4, 4, 4, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::medianBlur(framed, median, 5);
  median = median(cv::Rect({4, 4}, size_)).clone();
  expect(median, [](const BitArea& area, const BitMask& in, BitMask& out) { takeMedian(area, in, out); });
  cv::dilate(median, near, square(1));
  const BitMask medians = Bits(median).mask;
  expect((near & bytes_) | median, [&](const BitArea& area, const BitMask& in, BitMask& out) {
    regrowCorners(area, in, medians, out);
  });
}

TEST_P(BitOpsTest, GrowsWithinMaskByOnePixelAlsoInPlace) {
  cv::Mat1b noise(size_), grown;
  cv::RNG(4).fill(noise, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat1b within = noise < 130;
  cv::dilate(bytes_, grown, square(1));
  grown &= within;
  const BitMask allowed = Bits(within).mask;
  expect(grown,
         [&](const BitArea& area, const BitMask& in, BitMask& out) { growWithin(area, in, allowed, out); });
  Bits onto(within);
  growWithin(onto.area, Bits(bytes_).mask, onto.mask, onto.mask);
  EXPECT_EQ(cv::countNonZero(Bits::bytesOf(onto.mask) != grown), 0);
}

INSTANTIATE_TEST_SUITE_P(Densities, BitOpsTest, ::testing::Values(20, 128, 236));

TEST(BitMask, PacksAndClearsOnlyTheStrips) {
  cv::Mat1b bytes(32, 200), expected(bytes.size(), std::uint8_t{0});
  cv::RNG(5).fill(bytes, cv::RNG::UNIFORM, 0, 3);
  const std::vector<Strip> strips = {{1, 16, 48}, {1, 176, 200}, {5, 0, 112}, {6, 52, 124}};
  for (const Strip& s : strips) {
    const cv::Rect rect(s.begin_px, s.cell_row * FloorView::kCell, s.end_px - s.begin_px, FloorView::kCell);
    expected(rect).setTo(255, bytes(rect) != 0);
  }
  Bits bits(bytes, strips);
  EXPECT_EQ(cv::countNonZero(Bits::bytesOf(bits.mask) != expected), 0);
  clear(bits.area, bits.mask);
  EXPECT_EQ(cv::countNonZero(Bits::bytesOf(bits.mask)), 0);
}

TEST(BitMask, ClearsAndKeepsColumnsOfARow) {
  const cv::Mat1b set(8, 200, std::uint8_t{255});
  cv::Mat1b other(set.size(), std::uint8_t{0}), expected = set.clone();
  other.colRange(60, 70).setTo(255);
  expected(cv::Rect(5, 2, 130, 1)).setTo(0);
  expected(cv::Rect(50, 3, 14, 1)).setTo(0);
  expected(cv::Rect(60, 3, 4, 1)).setTo(255);
  expected(cv::Rect(64, 4, 64, 1)).setTo(0);
  Bits bits(set);
  bits.mask.clear(2, 5, 135);
  bits.mask.keep(3, 50, 64, Bits(other).mask);
  bits.mask.clear(4, 64, 128);
  bits.mask.clear(5, 64, 64);
  EXPECT_EQ(cv::countNonZero(Bits::bytesOf(bits.mask) != expected), 0);
}

TEST(Strips, ClearsOnlyTheStrips) {
  cv::Mat1b mask(32, 64, std::uint8_t{9});
  clearStrips({{1, 16, 48}, {5, 0, 16}}, mask);
  EXPECT_EQ(cv::countNonZero(mask == 0), (32 + 16) * FloorView::kCell);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(16, 4, 32, 4))), 0);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(0, 20, 16, 4))), 0);
}

}  // namespace
}  // namespace omnifleet::ground
