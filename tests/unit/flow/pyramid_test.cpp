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

}  // namespace
}  // namespace omnifleet::flow
