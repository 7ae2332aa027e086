#include "local_mapper/wheel_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::local_mapper {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kSecond_ns = 1000000000, kPeriod_ns = 200000000;
constexpr TimeNs kFirst_ns = 1000 * kSecond_ns;

/// Feeds frames and returns the first message.
std::optional<Message> feed(WheelCheck& check, int frames, bool has_motion, const WheelCheck::Rows& rows) {
  for (int k = 0; k < frames; ++k)
    if (auto message = check.add(kFirst_ns + k * kPeriod_ns, has_motion, rows)) return message;
  return std::nullopt;
}

TEST(WheelCheck, ReportsBothIntervalsIfNoSampleMeetsAFrame) {
  WheelCheck check("r1");
  const WheelCheck::Rows rows{100 * kSecond_ns, 108 * kSecond_ns, true};
  EXPECT_FALSE(feed(check, WheelCheck::kFrames - 1, false, rows)) << "too early to decide";
  const auto message = check.add(kFirst_ns + 9 * kPeriod_ns, false, rows);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kWheelsUnmatched);
  EXPECT_THAT(message->text, HasSubstr("1000.000 to 1001.800 s"));
  EXPECT_THAT(message->text, HasSubstr("100.000 to 108.000 s"));
}

TEST(WheelCheck, ReportsOnceIfNoSampleArrives) {
  WheelCheck check("r1");
  const auto message = feed(check, WheelCheck::kFrames, false, {});
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kWheelsUnmatched);
  EXPECT_THAT(message->text, HasSubstr("during the first 10 frames"));
  EXPECT_FALSE(feed(check, 100, false, {})) << "reported once";
}

TEST(WheelCheck, StaysSilentOnceWheelsGaveAMotion) {
  WheelCheck check("r1");
  EXPECT_FALSE(check.add(kFirst_ns, false, {kFirst_ns, kFirst_ns, true})) << "the first frame has no motion";
  EXPECT_FALSE(check.add(kFirst_ns + kPeriod_ns, true, {kFirst_ns, kFirst_ns, true}));
  EXPECT_FALSE(feed(check, 100, false, {kFirst_ns, kFirst_ns, true})) << "a later outage is another matter";
}

}  // namespace
}  // namespace omnifleet::local_mapper
