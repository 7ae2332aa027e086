#include "flow/pyramid.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/unit/flow/cells.h"

namespace omnifleet::flow {
namespace {

TEST(Pyramid, MatchesOpenCvBitByBitAtEvenAndOddSizes) {
  cv::RNG random(5);
  for (const cv::Size size : {cv::Size(160, 120), cv::Size(163, 91), cv::Size(64, 37), cv::Size(41, 40)}) {
    cv::Mat3b image(size);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    Pyramid pyramid(4);
    pyramid.build(image);
    cv::Mat1b expected, coarser;
    cv::cvtColor(image, expected, cv::COLOR_BGR2GRAY);
    for (int k = 0; k < pyramid.size(); ++k) {
      ASSERT_EQ(pyramid.level(k).size(), expected.size());
      EXPECT_EQ(cv::countNonZero(pyramid.level(k) != expected), 0) << size << " level " << k;
      cv::pyrDown(expected, coarser);
      expected = coarser.clone();
    }
  }
}

TEST(Pyramid, MatchesWholePyramidWithinRectangles) {
  cv::RNG random(6);
  constexpr int kLevels = 3;
  const int loss = Pyramid::lossOf(kLevels);
  for (const cv::Size size : {cv::Size(320, 240), cv::Size(323, 201)}) {
    cv::Mat3b image(size);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    Pyramid whole(kLevels), some(kLevels);
    whole.build(image);
    const cv::Rect frame(cv::Point(0, 0), size);
    for (int k = 0; k < 40; ++k) {
      cv::Rect rect(random.uniform(-20, size.width - 20), random.uniform(-20, size.height - 20),
                    random.uniform(2 * loss + 1, 150), random.uniform(2 * loss + 1, 150));
      rect &= frame;
      some.build(cv::Mat3b::zeros(size));
      some.build(image, {rect, {0, 0, 0, 0}});
      for (int level = 0; level < kLevels; ++level) {
        const cv::Mat1b& expected = whole.level(level);
        for (int y = 0; y < expected.rows; ++y) {
          for (int x = 0; x < expected.cols; ++x) {
            const cv::Point at(x << level, y << level);
            const auto within = [](int p, int begin, int end, int limit, int by) {
              return p >= (begin == 0 ? 0 : begin + by) && p < (end == limit ? limit : end - by);
            };
            if (!within(at.x, rect.x, rect.x + rect.width, size.width, loss)) continue;
            if (!within(at.y, rect.y, rect.y + rect.height, size.height, loss)) continue;
            ASSERT_EQ(some.level(level)(y, x), expected(y, x)) << rect << " level " << level << " " << at;
          }
        }
      }
    }
  }
}

/// Cells with a linear brightness, so that the value of a pixel gives its position.
TEST(Pyramid, PlacesCellLevelsAtTheirOffset) {
  const auto brightness = [](float x, float y) { return 20.0f + 0.5f * x + 0.3f * y; };
  cv::Mat3b image(200, 300);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image(y, x) = cv::Vec3b::all(
          cv::saturate_cast<std::uint8_t>(brightness(static_cast<float>(x), static_cast<float>(y))));
  const testing::Cells cells(image);
  const std::vector<cv::Rect> all{{0, 0, image.cols, image.rows}};
  Pyramid pyramid(4), smoothed(4);
  pyramid.build(image, all, cells.colours(), all);
  smoothed.build(image);
  for (int level = 0; level < pyramid.size(); ++level) {
    const cv::Mat1b& pixels = pyramid.level(level);
    ASSERT_EQ(pixels.size(), smoothed.level(level).size());
    if (level < Pyramid::kCellLevel) {
      EXPECT_EQ(cv::countNonZero(pixels != smoothed.level(level)), 0);
    }
    const auto scale = static_cast<float>(1 << level);
    const auto place = [&](int i) { return static_cast<float>(i) * scale + pyramid.offset_px(level); };
    for (int y = 2; y + 2 < pixels.rows; ++y)
      for (int x = 2; x + 2 < pixels.cols; ++x)
        ASSERT_NEAR(pixels(y, x), brightness(place(x), place(y)), 1.01) << level;  // rounded twice
  }
}

TEST(Pyramid, RepeatsOutermostCellsBeyondKnownOnes) {
  const cv::Mat3b image(64, 96, cv::Vec3b(100, 100, 100));
  testing::Cells cells(image);
  for (cv::Range& row : cells.known()) row = {5, 20};
  const cv::Mat3f& means = cells.colours().means;
  cv::Mat3f(means).colRange(0, 5).setTo(0);
  cv::Mat3f(means).colRange(20, means.cols).setTo(0);
  const std::vector<cv::Rect> all{{0, 0, image.cols, image.rows}};
  Pyramid pyramid(3);
  pyramid.build(image, all, cells.colours(), all);
  EXPECT_EQ(cv::countNonZero(pyramid.level(2) != 100), 0);
}

}  // namespace
}  // namespace omnifleet::flow
