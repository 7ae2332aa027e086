#include "bus/silence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

/// Checks for silent services twice per second, as the real callers do.
class SilenceTest : public testing::Test {
 protected:
  std::vector<std::string> after(milliseconds time) {
    std::vector<std::string> reports;
    for (const auto end = now_ + time; now_ < end;) {
      now_ += milliseconds(500);
      reports.clear();
      for (const Silence::Silent& one : silence_.silent(now_))
        reports.push_back(one.name + ": " + toString(one));
    }
    return reports;
  }
  void publish(const std::string& name, bool finished = false) { silence_.heard(name, finished, now_); }

  Silence::Clock::time_point now_{seconds(1000)};
  Silence silence_{{seconds(3), seconds(15)}};
};

TEST_F(SilenceTest, ReportsServiceUntilItsNextStatus) {
  publish("camera r1/fisheye");
  publish("world");
  EXPECT_THAT(after(seconds(3)), IsEmpty());
  publish("world");
  EXPECT_THAT(after(seconds(1)), ElementsAre("camera r1/fisheye: silent for 4 s"));
  EXPECT_THAT(after(seconds(3)), ElementsAre("camera r1/fisheye: silent for 7 s", "world: silent for 4 s"));
  publish("camera r1/fisheye");
  EXPECT_THAT(after(seconds(1)), ElementsAre("world: silent for 5 s"));
}

TEST_F(SilenceTest, ReportsExpectedServiceThatNeverStartsAfterLongerLimit) {
  silence_.expect("localizer", now_);
  EXPECT_THAT(after(seconds(15)), IsEmpty());
  EXPECT_THAT(after(seconds(1)), ElementsAre("localizer: not heard in 16 s"));
  publish("localizer");
  silence_.expect("localizer", now_);
  EXPECT_THAT(after(seconds(4)), ElementsAre("localizer: silent for 4 s")) << "a status has arrived";
}

TEST_F(SilenceTest, IgnoresFinishedService) {
  publish("world", true);
  EXPECT_THAT(after(seconds(60)), IsEmpty());
  publish("world");
  EXPECT_THAT(after(seconds(4)), ElementsAre("world: silent for 4 s")) << "restarted";
}

TEST_F(SilenceTest, IgnoresTimeInWhichTheCallerWasStalled) {
  publish("world");
  EXPECT_THAT(after(seconds(2)), IsEmpty());
  now_ += seconds(60);  // suspended by job control, or the machine slept
  EXPECT_THAT(after(seconds(1)), IsEmpty());
  EXPECT_THAT(after(seconds(1)), ElementsAre("world: silent for 3 s"));
}

}  // namespace
}  // namespace omnifleet::bus
