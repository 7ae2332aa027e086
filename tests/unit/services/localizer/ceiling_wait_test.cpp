// Live frames that wait for the ceiling cameras.

#include "localizer/ceiling_wait.h"

#include <gtest/gtest.h>

namespace omnifleet::localizer {
namespace {

using std::chrono::milliseconds;

constexpr TimeNs kStep_ns = 200'000'000;
const CeilingWait::Clock::time_point kStart{std::chrono::seconds(100)};

TEST(CeilingWait, AFrameWaitsForEachCameraThatReports) {
  CeilingWait wait({});
  EXPECT_TRUE(wait.waits(5 * kStep_ns, {4 * kStep_ns, 5 * kStep_ns}, kStart));
  EXPECT_FALSE(wait.waits(5 * kStep_ns, {5 * kStep_ns, 5 * kStep_ns}, kStart + milliseconds(10)));
  EXPECT_FALSE(wait.until());
}

TEST(CeilingWait, AFrameWaitsOnlyForSoLong) {
  CeilingWait wait({});
  EXPECT_TRUE(wait.waits(5 * kStep_ns, {4 * kStep_ns}, kStart));
  ASSERT_TRUE(wait.until());
  EXPECT_EQ(*wait.until(), kStart + milliseconds(150));
  EXPECT_TRUE(wait.waits(5 * kStep_ns, {4 * kStep_ns}, kStart + milliseconds(149)));
  EXPECT_FALSE(wait.waits(5 * kStep_ns, {4 * kStep_ns}, kStart + milliseconds(150)));
}

TEST(CeilingWait, TheNextFrameWaitsAnew) {
  CeilingWait wait({});
  EXPECT_TRUE(wait.waits(5 * kStep_ns, {4 * kStep_ns}, kStart));
  EXPECT_TRUE(wait.waits(6 * kStep_ns, {5 * kStep_ns}, kStart + milliseconds(200)));
  EXPECT_EQ(*wait.until(), kStart + milliseconds(350));
}

// Unplugged: its newest sample is more than a second old.
TEST(CeilingWait, ACameraThatIsSilentDelaysNothing) {
  CeilingWait wait({});
  EXPECT_FALSE(wait.waits(10 * kStep_ns, {4 * kStep_ns}, kStart));
  EXPECT_FALSE(wait.waits(10 * kStep_ns, {}, kStart)) << "none has sent anything";
}

TEST(CeilingWait, WithoutAFrameNothingWaits) {
  CeilingWait wait({});
  EXPECT_FALSE(wait.waits(std::nullopt, {4 * kStep_ns}, kStart));
  EXPECT_FALSE(wait.until());
}

}  // namespace
}  // namespace omnifleet::localizer
