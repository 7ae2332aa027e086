#include "localizer/pose_gaps.h"

#include <gtest/gtest.h>

namespace omnifleet::localizer {
namespace {

constexpr TimeNs kSecond = 1'000'000'000;

TEST(PoseGaps, AreReportedOnceByTheFirstPoseAfterThem) {
  PoseGaps gaps{{}};
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * kSecond / 5));
  EXPECT_FALSE(gaps.gapBefore("r2", 30 * kSecond)) << "the first pose of a robot follows nothing";
  const auto gap_s = gaps.gapBefore("r1", 9 * kSecond / 5 + 25 * kSecond);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 25.0);
  EXPECT_FALSE(gaps.gapBefore("r1", 9 * kSecond / 5 + 25 * kSecond + kSecond / 5));
}

/// A robot that publishes a frame every three seconds.
TEST(PoseGaps, AreLongerThanSeveralIntervals) {
  PoseGaps gaps{{}};
  for (int i = 0; i < 2; ++i) gaps.gapBefore("r1", i * 3 * kSecond);
  for (int i = 2; i < 5; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * 3 * kSecond));
  EXPECT_FALSE(gaps.gapBefore("r1", 26 * kSecond));
  EXPECT_TRUE(gaps.gapBefore("r1", 100 * kSecond));
}

TEST(PoseGaps, IncludeTheTimeBeforeALocalizerTookOver) {
  PoseGaps gaps{{}};
  gaps.know("r1", 100 * kSecond);
  const auto gap_s = gaps.gapBefore("r1", 110 * kSecond);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 10.0);
}

}  // namespace
}  // namespace omnifleet::localizer
