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

/// One that was called a robot by its shape while nobody had told a place; then the fleet of one other does,
/// `apart_m` from it.
TrackState afterTheFirstPlaces(double apart_m, double shape) {
  LocalMap map;
  map.objects.emplace_back();
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  Peer peer{"r2", BodyModel(body)};
  TrackState track(1, PrismFilter({}, {1.5, 0.0}, 0.15));
  track.kind = shape > 0.0 ? ObjectKind::kRobot : ObjectKind::kObstacle;
  track.blob = 0;
  track.views = 2;
  track.age_s = 2.0;
  track.evidence.shape = shape;
  std::vector<TrackState> tracks = {track};
  KindJudge judge({}, 0.15);
  OwnMotion own;
  own.advance(Motion{}, 1);
  judge.judge(tracks, {peer}, map, own);
  EXPECT_EQ(tracks.front().kind, track.kind) << "nobody has told a place";
  peer.known = true;
  peer.centre_m = {1.5 + apart_m, 0.0};
  peer.covariance = 1e-4 * Eigen::Matrix2d::Identity();
  own.advance(Motion{}, 1 + kStep_ns);
  judge.judge(tracks, {peer}, map, own);
  return tracks.front();
}

TEST(KindJudge, WhatWasCalledBeforeAnyPlaceWasToldIsCalledAnewAtOnce) {
  EXPECT_EQ(afterTheFirstPlaces(1.5, 2.5).kind, ObjectKind::kObstacle);
  EXPECT_EQ(afterTheFirstPlaces(0.02, 2.5).kind, ObjectKind::kRobot);
  EXPECT_EQ(afterTheFirstPlaces(0.02, -2.0).kind, ObjectKind::kRobot);
  EXPECT_EQ(afterTheFirstPlaces(1.5, -2.0).kind, ObjectKind::kObstacle);
}

}  // namespace
}  // namespace omnifleet::tracking
