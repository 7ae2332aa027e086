// Labels are compared with OpenCV, colours with their definition.

#include "markers/blobs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

namespace omnifleet::markers {
namespace {

const std::vector<dataset::Rgb> kColours{{20, 90, 220}, {230, 60, 60}, {60, 200, 60}};

TEST(ColourTable, KeepsClassUnderDimmerLight) {
  const ColourTable table(kColours, {0.16, 40, 0.25});
  EXPECT_EQ(table.classes(), 4U);
  for (std::size_t c = 0; c < kColours.size(); ++c) {
    for (const double gain : {0.4, 0.55, 0.8, 1.0}) {
      std::uint8_t bgr[3];
      for (std::size_t i = 0; i < 3; ++i) bgr[i] = static_cast<std::uint8_t>(kColours[c][2 - i] * gain);
      EXPECT_EQ(table.classOf(bgr), c + 1) << c << " at " << gain;
    }
  }
  const std::uint8_t grey[] = {120, 122, 121}, dark[] = {30, 10, 3}, yellow[] = {40, 200, 230};
  EXPECT_EQ(table.classOf(grey), 0);
  EXPECT_EQ(table.classOf(dark), 0);
  EXPECT_EQ(table.classOf(yellow), 0);
}

TEST(BlobFinder, MatchesOpenCvOnRandomMasks) {
  const ColourTable table(kColours, {0.16, 40, 0.25});
  cv::RNG random(8);
  BlobFinder finder;
  for (int round = 0; round < 5; ++round) {
    cv::Mat image(60, 83, CV_8UC3, cv::Scalar::all(128));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const int c = random.uniform(0, 5);
        if (c < 3)
          image.at<cv::Vec3b>(y, x) = {kColours[static_cast<std::size_t>(c)][2],
                                       kColours[static_cast<std::size_t>(c)][1],
                                       kColours[static_cast<std::size_t>(c)][0]};
      }
    }
    cv::medianBlur(image, image, 3);
    using Key = std::array<int, 6>;
    std::vector<Key> found, reference;
    for (const Blob& b : finder.find(image, table, 4)) {
      found.push_back({b.colour, b.area_px, b.left, b.top, b.right - b.left + 1, b.bottom - b.top + 1});
    }
    for (int colour = 1; colour <= 3; ++colour) {
      cv::Mat mask(image.size(), CV_8U), labels, stats, centroids;
      for (int y = 0; y < image.rows; ++y) {
        for (int x = 0; x < image.cols; ++x)
          mask.at<std::uint8_t>(y, x) = table.classOf(image.ptr(y) + 3 * x) == colour;
      }
      const int n = cv::connectedComponentsWithStats(mask, labels, stats, centroids, 8);
      for (int i = 1; i < n; ++i) {
        if (stats.at<int>(i, cv::CC_STAT_AREA) < 4) continue;
        reference.push_back({colour, stats.at<int>(i, cv::CC_STAT_AREA), stats.at<int>(i, cv::CC_STAT_LEFT),
                             stats.at<int>(i, cv::CC_STAT_TOP), stats.at<int>(i, cv::CC_STAT_WIDTH),
                             stats.at<int>(i, cv::CC_STAT_HEIGHT)});
      }
    }
    std::sort(found.begin(), found.end());
    std::sort(reference.begin(), reference.end());
    EXPECT_EQ(found, reference);
    EXPECT_GT(found.size(), 10U);
  }
}

TEST(BlobFinder, FindsSameBlobsInWindowsAsInWholeImage) {
  const ColourTable table(kColours, {0.16, 40, 0.25});
  cv::RNG random(4);
  cv::Mat image(120, 200, CV_8UC3, cv::Scalar::all(128));
  for (int i = 0; i < 60; ++i) {
    const auto& c = kColours[static_cast<std::size_t>(random.uniform(0, 3))];
    cv::ellipse(image, {random.uniform(0, 200), random.uniform(0, 120)},
                {random.uniform(2, 9), random.uniform(2, 9)}, random.uniform(0, 180), 0, 360,
                cv::Scalar(c[2], c[1], c[0]), cv::FILLED);
  }
  const std::vector<cv::Rect> windows{{10, 15, 60, 40}, {50, 30, 70, 50}, {150, 0, 50, 120}, {3, 90, 41, 20}};
  using Key = std::array<int, 6>;
  const auto keys = [](const std::vector<Blob>& blobs) {
    std::vector<Key> all;
    for (const Blob& b : blobs) all.push_back({b.colour, b.area_px, b.left, b.top, b.right, b.bottom});
    std::sort(all.begin(), all.end());
    return all;
  };
  BlobFinder finder;
  // The first two windows overlap, so they merge into one. No blob continues beyond the border of the image.
  const std::vector<cv::Rect> apart{windows[0] | windows[1], windows[2], windows[3]};
  std::vector<Blob> within;
  for (const Blob& b : finder.find(image, table, 4)) {
    const bool inside = std::any_of(apart.begin(), apart.end(), [&](const cv::Rect& w) {
      return (b.left > w.x || w.x == 0) && (b.top > w.y || w.y == 0) && b.left >= w.x && b.top >= w.y &&
             (b.right + 1 < w.br().x || w.br().x == 200) && (b.bottom + 1 < w.br().y || w.br().y == 120) &&
             b.right < w.br().x && b.bottom < w.br().y;
    });
    if (inside) within.push_back(b);
  }
  const auto expected = keys(within);
  EXPECT_EQ(keys(finder.find(image, table, 4, windows)), expected);
  EXPECT_GT(expected.size(), 5U);
}

TEST(ColourTable, FindsEveryColourInFastTest) {
  const ColourTable table(kColours, {0.16, 40, 0.25});
  std::uint8_t pixels[3 * ColourTable::kBlock];
  int coloured = 0, skipped = 0;
  for (int colour = 0; colour < 1 << 15; ++colour) {
    for (int i = 0; i < ColourTable::kBlock; ++i) pixels[3 * i] = pixels[3 * i + 1] = pixels[3 * i + 2] = 120;
    std::uint8_t* one = pixels + 3 * (colour % ColourTable::kBlock);
    for (int c = 0; c < 3; ++c) one[c] = static_cast<std::uint8_t>((colour >> 5 * c & 31) * 8 + colour % 8);
    const bool may = table.blocksWithout(pixels, 1) == 0;
    coloured += table.classOf(one) != 0 ? 1 : 0;
    skipped += may ? 0 : 1;
    ASSERT_TRUE(may || table.classOf(one) == 0) << colour;
  }
  EXPECT_GT(coloured, 100);
  EXPECT_GT(skipped, 5000);  // grey and almost grey colours
}

}  // namespace
}  // namespace omnifleet::markers
