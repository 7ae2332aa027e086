// Why the times of two streams do not meet. The expected causes follow from how the times were made.
#include "observation/time_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kNs = 1000000000;
constexpr TimeRange kFrames{1700000000 * kNs, 1700000060 * kNs};

std::string cause(TimeRange stream, TimeRange frames = kFrames) {
  return likelyCause("times of wheels", stream, frames);
}

TEST(TimeRange, MeetsOnlyWhatOverlapsWithinTheSlack) {
  const TimeRange first{10, 20};
  EXPECT_TRUE(first.meets({20, 30}, 0));
  EXPECT_FALSE(first.meets({21, 30}, 0));
  EXPECT_TRUE(first.meets({21, 30}, 1));
  EXPECT_FALSE(first.meets({0, 8}, 1));
}

TEST(LikelyCause, NamesUnit) {
  EXPECT_THAT(cause({1700000000000000, 1700000060000000}),
              HasSubstr("times of wheels seem to be in microseconds"));
  EXPECT_THAT(cause({1700000000000, 1700000060000}), HasSubstr("in milliseconds"));
  EXPECT_THAT(cause({1700000003, 1700000060}), HasSubstr("in seconds"));
  EXPECT_THAT(cause(kFrames, {1700000000000000, 1700000060000000}),
              HasSubstr("the frames seem to be in micro"));
}

TEST(LikelyCause, NamesBothStreamsWhereEitherMayHaveTheWrongUnit) {
  constexpr TimeNs kMicro = 1000;
  const TimeRange since_start{40 * kNs, 100 * kNs}, a_thousand_times{40000 * kNs, 100000 * kNs};
  EXPECT_THAT(cause(since_start, a_thousand_times),
              HasSubstr("times of wheels seem to be in microseconds, not nanoseconds, or the frames are in "
                        "nanoseconds under a header that says [us]"));
  EXPECT_THAT(cause(a_thousand_times, since_start),
              HasSubstr("or times of wheels are in nanoseconds under a header that says [us]"));
  EXPECT_THAT(cause({kFrames.first_ns / kMicro, kFrames.last_ns / kMicro}), testing::Not(HasSubstr("header")))
      << "a system time is in the right unit";
}

TEST(LikelyCause, NamesTimeZone) {
  EXPECT_THAT(cause({(1700000002 - 3600) * kNs, (1700000060 - 3600) * kNs}), HasSubstr("-1 h off"));
  EXPECT_THAT(cause({(1700000000 + 19800) * kNs, (1700000060 + 19800) * kNs}), HasSubstr("+5.5 h off"));
}

TEST(LikelyCause, NamesTimeSinceStartOfAMachine) {
  EXPECT_THAT(cause({4000 * kNs, 4060 * kNs}), HasSubstr("count since the start of a machine"));
  EXPECT_THAT(cause(kFrames, {4000 * kNs, 4060 * kNs}), HasSubstr("count since 1970"));
}

TEST(LikelyCause, NamesDifferenceOtherwise) {
  EXPECT_THAT(cause({100 * kNs, 108 * kNs}, {1000 * kNs, 1008 * kNs}),
              HasSubstr("another clock, -900.000 s off"));
}

}  // namespace
}  // namespace omnifleet
