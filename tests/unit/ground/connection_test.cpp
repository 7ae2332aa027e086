#include <gtest/gtest.h>

#include <random>

#include "ground/region_connection.h"

namespace omnifleet::ground {
namespace {

Blob block(int label, int x, int y, int width, int height) {
  Blob blob;
  blob.label = label;
  blob.rect = {x, y, width, height};
  blob.area_px = width * height;
  for (int row = y; row < y + height; ++row) blob.runs.push_back({row, x, x + width});
  return blob;
}

ConnectionOptions rectangles(int gap) {
  ConnectionOptions o;
  o.method = "rectangles";
  o.gap_px = gap;
  return o;
}

TEST(RegionConnection, JoinsOverlappingAndContainedRectangles) {
  RegionConnection connection(rectangles(0));
  const auto& joined = connection.connect(
      {block(1, 0, 0, 10, 10), block(2, 8, 8, 10, 4), block(3, 50, 50, 20, 20), block(4, 55, 55, 2, 2)});
  ASSERT_EQ(joined.size(), 2U);
  EXPECT_EQ(joined[0].rect, cv::Rect(0, 0, 18, 12));  // line 7 of Algorithm 1 is the height
  EXPECT_EQ(joined[1].rect, cv::Rect(50, 50, 20, 20));
  EXPECT_EQ(joined[0].area_px, 140);
}

TEST(RegionConnection, ComparesAllPairsUntilNothingChanges) {
  // The third block bridges the first two only after they have grown. Neighbours in the list do not touch.
  RegionConnection connection(rectangles(0));
  const auto& joined = connection.connect(
      {block(1, 0, 0, 5, 5), block(2, 20, 0, 5, 20), block(3, 4, 15, 17, 3), block(4, 0, 3, 5, 13)});
  ASSERT_EQ(joined.size(), 1U);
  EXPECT_EQ(joined[0].label, 1);
  for (std::size_t i = 1; i < joined[0].runs.size(); ++i)
    EXPECT_LE(joined[0].runs[i - 1].row, joined[0].runs[i].row);
}

TEST(RegionConnection, RelabelsAndSortsByPosition) {
  RegionConnection connection(rectangles(0));
  const auto& sorted =
      connection.connect({block(9, 30, 40, 5, 5), block(4, 60, 10, 5, 5), block(2, 10, 10, 5, 5)});
  ASSERT_EQ(sorted.size(), 3U);
  EXPECT_EQ(sorted[0].rect.x, 10);
  EXPECT_EQ(sorted[1].rect.x, 60);
  EXPECT_EQ(sorted[2].rect.y, 40);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(sorted[static_cast<std::size_t>(i)].label, i + 1);
}

TEST(RegionConnection, JoinsRegionsWithinTheGapOption) {
  const std::vector<Blob> apart = {block(1, 0, 0, 5, 5), block(2, 8, 0, 5, 5)};  // 3 background columns
  EXPECT_EQ(RegionConnection(rectangles(2)).connect(apart).size(), 2U);
  EXPECT_EQ(RegionConnection(rectangles(4)).connect(apart).size(), 1U);
  ConnectionOptions pixels;
  pixels.gap_px = 2;
  EXPECT_EQ(RegionConnection(pixels).connect(apart).size(), 2U);
  pixels.gap_px = 3;
  EXPECT_EQ(RegionConnection(pixels).connect(apart).size(), 1U);
}

TEST(RegionConnection, SeparatesByPixelsWhatRectanglesJoin) {
  Blob corner = block(1, 0, 0, 30, 2);  // an L around the second block
  for (int row = 2; row < 30; ++row) corner.runs.push_back({row, 0, 2});
  corner.rect = {0, 0, 30, 30};
  const std::vector<Blob> blobs = {corner, block(2, 15, 15, 10, 10)};
  EXPECT_EQ(RegionConnection(rectangles(0)).connect(blobs).size(), 1U);
  EXPECT_EQ(RegionConnection(ConnectionOptions{}).connect(blobs).size(), 2U);
}

TEST(PixelGap, EqualsBruteForceChebyshevDistance) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> place(0, 25), size(1, 6);
  for (int trial = 0; trial < 300; ++trial) {
    const Blob a = block(1, place(random), place(random), size(random), size(random));
    const Blob b = block(2, place(random), place(random), size(random), size(random));
    int expected = 1000;
    for (int ya = a.rect.y; ya < a.rect.br().y; ++ya)
      for (int xa = a.rect.x; xa < a.rect.br().x; ++xa)
        for (int yb = b.rect.y; yb < b.rect.br().y; ++yb)
          for (int xb = b.rect.x; xb < b.rect.br().x; ++xb)
            expected = std::min(expected, std::max({std::abs(xa - xb) - 1, std::abs(ya - yb) - 1, 0}));
    EXPECT_EQ(pixelGap(a, b, 8), std::min(expected, 9));
  }
}

TEST(ConnectionOptions, RejectsUnknownMethodAndNegativeGap) {
  EXPECT_THROW(ConnectionOptions::read(options::Section::parse("method: colours", "t.yaml")), options::Error);
  EXPECT_THROW(ConnectionOptions::read(options::Section::parse("gap_px: -1", "t.yaml")), options::Error);
  EXPECT_EQ(ConnectionOptions::read(options::Section::parse("method: rectangles", "t.yaml")).method,
            "rectangles");
}

}  // namespace
}  // namespace omnifleet::ground
