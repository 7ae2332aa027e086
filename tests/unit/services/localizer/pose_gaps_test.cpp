#include "localizer/pose_gaps.h"

#include <gtest/gtest.h>

namespace omnifleet::localizer {
namespace {

constexpr TimeNs kGapSecond = 1'000'000'000;

TEST(PoseGaps, AreReportedOnceByTheFirstPoseAfterThem) {
  PoseGaps gaps{{}};
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * kGapSecond / 5));
  EXPECT_FALSE(gaps.gapBefore("r2", 30 * kGapSecond)) << "the first pose of a robot follows nothing";
  const auto gap_s = gaps.gapBefore("r1", 9 * kGapSecond / 5 + 25 * kGapSecond);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 25.0);
  EXPECT_FALSE(gaps.gapBefore("r1", 9 * kGapSecond / 5 + 25 * kGapSecond + kGapSecond / 5));
}

/// A robot that publishes a frame every three seconds.
TEST(PoseGaps, AreLongerThanSeveralIntervals) {
  PoseGaps gaps{{}};
  for (int i = 0; i < 2; ++i) gaps.gapBefore("r1", i * 3 * kGapSecond);
  for (int i = 2; i < 5; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * 3 * kGapSecond));
  EXPECT_FALSE(gaps.gapBefore("r1", 26 * kGapSecond));
  EXPECT_TRUE(gaps.gapBefore("r1", 100 * kGapSecond));
}

TEST(PoseGaps, IncludeTheTimeBeforeALocalizerTookOver) {
  PoseGaps gaps{{}};
  gaps.know("r1", 100 * kGapSecond);
  const auto gap_s = gaps.gapBefore("r1", 110 * kGapSecond);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 10.0);
}

}  // namespace
}  // namespace omnifleet::localizer
