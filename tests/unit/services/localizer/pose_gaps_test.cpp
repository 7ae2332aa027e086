#include "localizer/pose_gaps.h"

#include <gtest/gtest.h>

namespace omnifleet::localizer {
namespace {

constexpr TimeNs kGapSecond = 1'000'000'000;

TEST(PoseGaps, AreReportedOnceByTheFirstPoseAfterThem) {
  PoseGaps gaps{{}};
  for (unsigned i = 0; i < 10; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * kGapSecond / 5, i));
  EXPECT_FALSE(gaps.gapBefore("r2", 30 * kGapSecond, 150)) << "the first pose of a robot follows nothing";
  const auto gap_s = gaps.gapBefore("r1", 9 * kGapSecond / 5 + 25 * kGapSecond, 9 + 125);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 25.0);
  EXPECT_FALSE(gaps.gapBefore("r1", 9 * kGapSecond / 5 + 25 * kGapSecond + kGapSecond / 5, 9 + 126));
}

/// A robot that publishes a frame every three seconds.
TEST(PoseGaps, AreLongerThanSeveralPeriods) {
  PoseGaps gaps{{}};
  for (unsigned i = 0; i < 5; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * 3 * kGapSecond, i));
  EXPECT_FALSE(gaps.gapBefore("r1", 26 * kGapSecond, 8));
  EXPECT_TRUE(gaps.gapBefore("r1", 100 * kGapSecond, 33));
}

TEST(PoseGaps, IncludeTheTimeBeforeALocalizerTookOver) {
  PoseGaps gaps{{}};
  gaps.know("r1", 100 * kGapSecond, 400);
  const auto gap_s = gaps.gapBefore("r1", 110 * kGapSecond, 440);
  ASSERT_TRUE(gap_s);
  EXPECT_DOUBLE_EQ(*gap_s, 10.0);
}

/// The link comes back for one frame only.
TEST(PoseGaps, AreReportedOneAfterAnother) {
  PoseGaps gaps{{}};
  gaps.know("r1", 100 * kGapSecond, 400);
  EXPECT_TRUE(gaps.gapBefore("r1", 110 * kGapSecond, 440));
  const auto gap_s = gaps.gapBefore("r1", 125 * kGapSecond, 500);
  ASSERT_TRUE(gap_s) << "the time of the first gap is not the period of the frames";
  EXPECT_DOUBLE_EQ(*gap_s, 15.0);
}

TEST(PoseGaps, IncludeTheTimeInWhichACameraWasRestarted) {
  PoseGaps gaps{{}};
  for (unsigned i = 0; i < 10; ++i) EXPECT_FALSE(gaps.gapBefore("r1", i * kGapSecond / 5, i));
  EXPECT_TRUE(gaps.gapBefore("r1", 8 * kGapSecond, 0));
}

}  // namespace
}  // namespace omnifleet::localizer
