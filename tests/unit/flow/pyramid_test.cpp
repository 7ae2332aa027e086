#include "flow/pyramid.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace omnifleet::flow {
namespace {

TEST(Pyramid, IsOpenCvsBitByBitAtEvenAndOddSizes) {
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

TEST(Pyramid, OfSomeRectanglesIsThatOfTheWholeThere) {
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

}  // namespace
}  // namespace omnifleet::flow
