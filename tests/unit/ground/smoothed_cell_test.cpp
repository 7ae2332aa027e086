#include "ground/smoothed_cell.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {
namespace {

template <int kChannels>
void expectBlurred(const cv::Mat& image) {
  cv::Mat blurred;
  cv::blur(image, blurred, {3, 3}, {-1, -1}, cv::BORDER_REPLICATE);
  std::uint8_t cell[FloorView::kCell * kCopyRow];
  for (int y = 0; y < image.rows; y += FloorView::kCell) {
    for (int x = 0; x < image.cols; x += FloorView::kCell) {
      smoothCell<kChannels>(image, x, y, cell);
      for (int j = 0; j < FloorView::kCell; ++j)
        for (int i = 0; i < FloorView::kCell * kChannels; ++i)
          ASSERT_EQ(cell[j * kCopyRow + i], blurred.ptr(y + j)[x * kChannels + i]) << x << ' ' << y;
    }
  }
}

TEST(SmoothedCell, MatchesOpenCvBoxFilterAlsoAtImageEdges) {
  cv::Mat3b colours(24, 32);
  cv::Mat1b greys(24, 32);
  cv::RNG random(3);
  random.fill(colours, cv::RNG::UNIFORM, 0, 256);
  random.fill(greys, cv::RNG::UNIFORM, 0, 256);
  expectBlurred<3>(colours);
  expectBlurred<1>(greys);
}

}  // namespace
}  // namespace omnifleet::ground
