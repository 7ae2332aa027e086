#include "bus/silence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

/// Looks twice a second, as who watches does.
class Watched : public testing::Test {
 protected:
  std::vector<std::string> after(milliseconds time) {
    std::vector<std::string> said;
    for (const auto end = now_ + time; now_ < end;) {
      now_ += milliseconds(500);
      said.clear();
      for (const Silence::Silent& one : silence_.silent(now_)) said.push_back(one.who + ": " + toString(one));
    }
    return said;
  }
  void speak(const std::string& who, bool finished = false) { silence_.heard(who, finished, now_); }

  Silence::Clock::time_point now_{seconds(1000)};
  Silence silence_{{seconds(3), seconds(15)}};
};

TEST_F(Watched, WhoSaysNothingMoreIsSilentUntilItSpeaks) {
  speak("camera r1/fisheye");
  speak("world");
  EXPECT_THAT(after(seconds(3)), IsEmpty());
  speak("world");
  EXPECT_THAT(after(seconds(1)), ElementsAre("camera r1/fisheye: silent for 4 s"));
  EXPECT_THAT(after(seconds(3)), ElementsAre("camera r1/fisheye: silent for 7 s", "world: silent for 4 s"));
  speak("camera r1/fisheye");
  EXPECT_THAT(after(seconds(1)), ElementsAre("world: silent for 5 s"));
}

TEST_F(Watched, WhoIsExpectedAndNeverSpeaksIsNamedLater) {
  silence_.expect("localizer", now_);
  EXPECT_THAT(after(seconds(15)), IsEmpty());
  EXPECT_THAT(after(seconds(1)), ElementsAre("localizer: not heard in 16 s"));
  speak("localizer");
  silence_.expect("localizer", now_);
  EXPECT_THAT(after(seconds(4)), ElementsAre("localizer: silent for 4 s")) << "it has spoken";
}

TEST_F(Watched, WhoHasFinishedMayBeSilent) {
  speak("world", true);
  EXPECT_THAT(after(seconds(60)), IsEmpty());
  speak("world");
  EXPECT_THAT(after(seconds(4)), ElementsAre("world: silent for 4 s")) << "started again";
}

TEST_F(Watched, WhenTheWatchItselfWasHeldUpNobodyWasSilent) {
  speak("world");
  EXPECT_THAT(after(seconds(2)), IsEmpty());
  now_ += seconds(60);  // stopped by job control, or a machine that slept
  EXPECT_THAT(after(seconds(1)), IsEmpty());
  EXPECT_THAT(after(seconds(1)), ElementsAre("world: silent for 3 s"));
}

}  // namespace
}  // namespace omnifleet::bus
