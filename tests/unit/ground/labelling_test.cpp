#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/labelling.h"
#include "tests/unit/ground/bits.h"

namespace omnifleet::ground {
namespace {

/// Compares with OpenCV's labels: every blob must be exactly one of its components.
void compareWithOpenCv(const cv::Mat1b& mask, int min_area) {
  Labeller labeller;
  const testing::Bits bits(mask);
  const auto& blobs = labeller.label(bits.mask, bits.area, min_area);
  cv::Mat labels, stats, centroids;
  const int n = cv::connectedComponentsWithStats(mask, labels, stats, centroids, 8, CV_32S);
  int expected = 0;
  for (int k = 1; k < n; ++k) expected += stats.at<int>(k, cv::CC_STAT_AREA) >= min_area ? 1 : 0;
  ASSERT_EQ(static_cast<int>(blobs.size()), expected);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const auto& blob = blobs[i];
    EXPECT_EQ(blob.label, static_cast<int>(i) + 1);
    const int k = labels.at<int>(blob.runs.front().row, blob.runs.front().begin);
    ASSERT_GT(k, 0);
    EXPECT_EQ(blob.area_px, stats.at<int>(k, cv::CC_STAT_AREA));
    EXPECT_EQ(blob.rect, cv::Rect(stats.at<int>(k, cv::CC_STAT_LEFT), stats.at<int>(k, cv::CC_STAT_TOP),
                                  stats.at<int>(k, cv::CC_STAT_WIDTH), stats.at<int>(k, cv::CC_STAT_HEIGHT)));
    int pixels = 0;
    for (const auto& run : blob.runs) {
      for (int x = run.begin; x < run.end; ++x, ++pixels) ASSERT_EQ(labels.at<int>(run.row, x), k);
    }
    EXPECT_EQ(pixels, blob.area_px);
  }
}

TEST(Labeller, MatchesOpenCvOnNoiseOfAnyDensity) {
  std::mt19937 random(7);
  for (const double density : {0.05, 0.3, 0.45, 0.6, 0.95, 1.0}) {
    cv::Mat1b mask(96, 328);
    std::bernoulli_distribution set(density);
    for (auto& p : mask) p = set(random) ? 255 : 0;
    compareWithOpenCv(mask, 1);
    compareWithOpenCv(mask, 9);
  }
}

TEST(Labeller, MatchesOpenCvOnBranchesThatMergeLate) {
  cv::Mat1b mask(96, 128, std::uint8_t{0});
  for (int r = 4; r < 44; r += 6) cv::circle(mask, {60, 48}, r, 255, 2);
  cv::line(mask, {60, 48}, {60, 95}, 255, 3);
  cv::ellipse(mask, {110, 20}, {10, 15}, 0, 180, 360, 255, 3);
  compareWithOpenCv(mask, 1);
}

TEST(Labeller, ReadsOnlyTheStrips) {
  cv::Mat1b mask(40, 40, std::uint8_t{255});
  Labeller labeller;
  const testing::Bits bits(mask, {{2, 8, 16}, {3, 8, 12}, {8, 0, 4}}), none(mask, {});
  const auto& blobs = labeller.label(bits.mask, bits.area, 1);
  ASSERT_EQ(blobs.size(), 2U);
  EXPECT_EQ(blobs[0].area_px, 4 * 8 + 4 * 4);
  EXPECT_EQ(blobs[1].rect, cv::Rect(0, 32, 4, 4));
  EXPECT_TRUE(labeller.label(none.mask, none.area, 1).empty());
}

}  // namespace
}  // namespace omnifleet::ground
