#include <gtest/gtest.h>

#include "ground/ground_histogram.h"

namespace omnifleet::ground {
namespace {

TEST(GroundHistogram, LearnsFloorAndExcludesObjectInSamples) {
  GroundHistogram histogram;
  for (int i = 0; i < 700; ++i) histogram.add(static_cast<std::uint8_t>(150 + i % 20), 160, 170);
  for (int i = 0; i < 300; ++i) histogram.add(30, 200, 220);
  EXPECT_NEAR(histogram.settle(0.004, 0, false), 0.7, 1e-9);
  EXPECT_TRUE(histogram.isGround(158, 160, 170));
  EXPECT_FALSE(histogram.isGround(30, 200, 220));
}

TEST(GroundHistogram, UsesAllModesInPaperMode) {
  GroundHistogram histogram;
  for (int i = 0; i < 700; ++i) histogram.add(150, 160, 170);
  for (int i = 0; i < 300; ++i) histogram.add(30, 200, 220);
  EXPECT_NEAR(histogram.settle(0.004, 0, true), 1.0, 1e-9);
  EXPECT_TRUE(histogram.isGround(30, 200, 220));
  EXPECT_FALSE(histogram.isGround(200, 30, 30));
}

TEST(GroundHistogram, PrefersSpreadFloorOverConcentratedObject) {
  // Uneven light spreads the floor over many bins. Each of them holds less than the object's single bin.
  GroundHistogram histogram;
  for (int i = 0; i < 600; ++i)
    histogram.add(static_cast<std::uint8_t>(80 + i % 120), static_cast<std::uint8_t>(80 + i % 120), 100);
  for (int i = 0; i < 400; ++i) histogram.add(10, 10, 220);
  histogram.settle(0.004, 0, false);
  EXPECT_TRUE(histogram.isGround(140, 140, 100));
  EXPECT_FALSE(histogram.isGround(10, 10, 220));
}

TEST(GroundHistogram, GrowsByWholeBinsAndClears) {
  GroundHistogram histogram;
  for (int i = 0; i < 100; ++i) histogram.add(100, 100, 100);  // bin 12, 12, 12: levels 96–103
  histogram.settle(0.01, 0, false);
  EXPECT_FALSE(histogram.isGround(104, 100, 100));
  histogram.settle(0.01, 1, false);
  EXPECT_TRUE(histogram.isGround(104, 100, 100));
  EXPECT_FALSE(histogram.isGround(112, 100, 100));
  histogram.clear();
  EXPECT_EQ(histogram.settle(0.01, 1, false), 0.0);
  EXPECT_FALSE(histogram.isGround(100, 100, 100));
}

}  // namespace
}  // namespace omnifleet::ground
