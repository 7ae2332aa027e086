#include "local_mapper/wheel_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::local_mapper {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kSecond_ns = 1000000000, kPeriod_ns = 200000000;
constexpr TimeNs kFirst_ns = 1000 * kSecond_ns;

/// Feeds frames and returns the first message.
std::optional<Message> feed(WheelCheck& check, int frames, bool has_motion,
                            const std::optional<TimeRange>& rows) {
  for (int k = 0; k < frames; ++k)
    if (auto message = check.add(kFirst_ns + k * kPeriod_ns, has_motion, rows)) return message;
  return std::nullopt;
}

TEST(WheelCheck, ReportsBothIntervalsIfNoSampleMeetsAFrame) {
  WheelCheck check("r1");
  const TimeRange rows{100 * kSecond_ns, 108 * kSecond_ns};
  EXPECT_FALSE(feed(check, WheelCheck::kFrames - 1, false, rows)) << "too early to decide";
  const auto message = check.add(kFirst_ns + 9 * kPeriod_ns, false, rows);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kWheelsUnmatched);
  EXPECT_THAT(message->text, HasSubstr("1000.000 to 1001.800 s"));
  EXPECT_THAT(message->text, HasSubstr("100.000 to 108.000 s"));
  EXPECT_THAT(message->text, HasSubstr("Likely cause: times of wheel samples seem to have another clock"));
}

TEST(WheelCheck, ReportsOnceIfNoSampleArrives) {
  WheelCheck check("r1");
  const auto message = feed(check, WheelCheck::kFrames, false, {});
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kWheelsUnmatched);
  EXPECT_THAT(message->text, HasSubstr("during the first 10 frames"));
  EXPECT_FALSE(feed(check, 100, false, {})) << "reported once";
  EXPECT_FALSE(check.finish({}));
}

TEST(WheelCheck, WaitsForWheelsAsLongAsItsPatience) {
  WheelCheck check("r1", 3 * kSecond_ns);
  EXPECT_FALSE(feed(check, 15, false, {})) << "15 frames last 2.8 s";
  const auto message = check.add(kFirst_ns + 15 * kPeriod_ns, false, {});
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kWheelsUnmatched);
}

/// A base driver whose rows arrive late, because its discovery took long, and whose clock is ahead.
TEST(WheelCheck, ReportsTimesOfRowsThatArriveAfterTheReportOfTheirAbsence) {
  WheelCheck check("r1");
  ASSERT_TRUE(feed(check, WheelCheck::kFrames, false, {}));
  const TimeNs next_ns = kFirst_ns + WheelCheck::kFrames * kPeriod_ns;
  const TimeRange rows{kFirst_ns + 3600 * kSecond_ns, kFirst_ns + 3601 * kSecond_ns};
  for (int k = 0; k + 1 < WheelCheck::kFrames; ++k)
    EXPECT_FALSE(check.add(next_ns + k * kPeriod_ns, false, rows)) << "the first rows may be too late";
  const auto message = check.add(next_ns + WheelCheck::kFrames * kPeriod_ns, false, rows);
  ASSERT_TRUE(message);
  EXPECT_THAT(message->text, HasSubstr("4600.000 to 4601.000 s"));
  EXPECT_THAT(message->text, HasSubstr("time zone"));
  EXPECT_FALSE(check.finish(rows)) << "reported once";
}

TEST(WheelCheck, ReportsAtTheEndOfAShortRun) {
  WheelCheck check("r1");
  EXPECT_FALSE(feed(check, 5, false, {}));
  const auto message = check.finish({});
  ASSERT_TRUE(message);
  EXPECT_THAT(message->text, HasSubstr("during the first 5 frames"));
}

TEST(WheelCheck, StaysSilentOnceWheelsGaveAMotion) {
  WheelCheck check("r1");
  const TimeRange rows{kFirst_ns, kFirst_ns};
  EXPECT_FALSE(check.add(kFirst_ns, false, rows)) << "the first frame has no motion";
  EXPECT_FALSE(check.add(kFirst_ns + kPeriod_ns, true, rows));
  EXPECT_FALSE(feed(check, 100, false, rows)) << "a later outage is another matter";
  EXPECT_FALSE(check.finish(rows));
}

}  // namespace
}  // namespace omnifleet::local_mapper
