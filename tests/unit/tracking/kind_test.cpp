// When a label is taken back.

#include <gtest/gtest.h>

#include "tracking/kind.h"

namespace omnifleet::tracking {
namespace {

constexpr TimeNs kStep_ns = 200'000'000;

/// Seconds until a robot whose evidence adds up to `log_odds` of one is called an obstacle; 10 if never.
double secondsUntilRenamed(double log_odds) {
  LocalMap map;
  map.objects.emplace_back();
  TrackState track(1, PrismFilter({}, {1.5, 0.0}, 0.5));
  track.kind = ObjectKind::kRobot;
  track.blob = 0;
  track.evidence.motion = 5.0;  // it drove
  track.evidence.shape = log_odds - track.evidence.motion;
  std::vector<TrackState> tracks = {track};
  KindJudge judge({}, 0.15);
  OwnMotion own;
  for (int frame = 0; frame < 50; ++frame) {
    own.advance(Motion{}, 1 + frame * kStep_ns);
    judge.judge(tracks, {}, map, own);
    if (tracks.front().kind != ObjectKind::kRobot) return 0.2 * frame;
  }
  return 10.0;
}

TEST(KindJudge, TakesALabelBackAtOnceWhereItIsSure) {
  EXPECT_NEAR(secondsUntilRenamed(-3.0), 0.4, 1e-9);  // 1 : 20, three frames
}

TEST(KindJudge, TakesALabelBackAfterAWhileWhereItIsLessSure) {
  EXPECT_GT(secondsUntilRenamed(-2.0), 0.9);  // 1 : 7
  EXPECT_LT(secondsUntilRenamed(-2.0), 1.5);
}

TEST(KindJudge, LeavesALabelThatIsMerelyDoubted) {
  EXPECT_EQ(secondsUntilRenamed(-1.0), 10.0);  // 1 : 3
}

}  // namespace
}  // namespace omnifleet::tracking
