// When KindJudge gives and changes a label.

#include <gtest/gtest.h>

#include "tracking/kind.h"

namespace omnifleet::tracking {
namespace {

constexpr TimeNs kStep_ns = 200'000'000;

/// Seconds until a robot with the given log-odds is labelled an obstacle; 10 if never.
double secondsUntilRenamed(double log_odds) {
  LocalMap map;
  map.objects.emplace_back();
  TrackState track(1, PrismFilter({}, {1.5, 0.0}, 0.5));
  track.kind = ObjectKind::kRobot;
  track.blob = 0;
  track.evidence.motion = 5.0;  // it moved earlier
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

TEST(KindJudge, ChangesLabelAfterThreeFramesWhenCertain) {
  EXPECT_NEAR(secondsUntilRenamed(-3.0), 0.4, 1e-9);  // odds 1 : 20, three frames
}

TEST(KindJudge, ChangesLabelAfterOneSecondWhenLessCertain) {
  EXPECT_GT(secondsUntilRenamed(-2.0), 0.9);  // odds 1 : 7
  EXPECT_LT(secondsUntilRenamed(-2.0), 1.5);
}

TEST(KindJudge, KeepsLabelThatIsOnlyDoubtful) {
  EXPECT_EQ(secondsUntilRenamed(-1.0), 10.0);  // odds 1 : 3
}

/// Label after two seconds of an object at `off_m` from the published place of a robot. @param sigma_m
/// combined σ of both places @param shape log-odds of its shape @param may_be_there the frame shows no floor
/// at the robot's published place
ObjectKind kindOfObjectBeside(double off_m, double sigma_m, double shape = -4.0, bool may_be_there = false) {
  LocalMap map;
  map.objects.emplace_back();
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  Peer peer{"r2", BodyModel(body)};
  peer.known = true;
  peer.may_be_there = may_be_there;
  peer.centre_m = {1.5, 0.0};
  const Eigen::Matrix2d covariance = 0.5 * sigma_m * sigma_m * Eigen::Matrix2d::Identity();
  peer.covariance = covariance;
  TrackState track(1, PrismFilter({}, {1.5 + off_m, 0.0}, 0.5));
  track.filter.placeAt({1.5 + off_m, 0.0}, Eigen::Vector2d::Zero(), covariance);
  track.blob = 0;
  track.views = 1;
  track.evidence.motion = -1.0;  // it stands still
  track.evidence.shape = shape;
  std::vector<TrackState> tracks = {track};
  KindJudge judge({}, 0.15);
  OwnMotion own;
  for (int frame = 0; frame < 10; ++frame) {
    own.advance(Motion{}, 1 + frame * kStep_ns);
    judge.judge(tracks, {peer}, map, own);
    ++tracks.front().views;
  }
  return tracks.front().kind;
}

TEST(KindJudge, AcceptsAnyShapeExactlyAtAPublishedPlace) {
  EXPECT_EQ(kindOfObjectBeside(0.02, 0.01), ObjectKind::kRobot);
  EXPECT_NE(kindOfObjectBeside(0.02, 0.06), ObjectKind::kRobot) << "the places are too uncertain";
  EXPECT_NE(kindOfObjectBeside(0.10, 0.01), ObjectKind::kRobot) << "it may stand beside the robot";
}

// An object with the shape of a robot, 0.75 m from a published place. If the robot may be hidden at its
// published place, the object is not the robot. If the floor is visible there, it may be the robot.
TEST(KindJudge, RejectsLookAlikeIfTheRobotMayBeHidden) {
  constexpr double kLooksLikeIt = 2.5;
  EXPECT_EQ(kindOfObjectBeside(0.75, 0.03, kLooksLikeIt), ObjectKind::kUnknown);
  EXPECT_EQ(kindOfObjectBeside(0.75, 0.03, kLooksLikeIt, true), ObjectKind::kObstacle);
}

// The gate holds for uncertain places too.
TEST(KindJudge, RejectsPeerBeyondItsGate) {
  EXPECT_EQ(kindOfObjectBeside(0.30, 0.3, 0.0), ObjectKind::kRobot);
  EXPECT_NE(kindOfObjectBeside(0.45, 0.3, 0.0), ObjectKind::kRobot);
}

}  // namespace
}  // namespace omnifleet::tracking
