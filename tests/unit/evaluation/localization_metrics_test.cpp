#include "evaluation/localization_metrics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::evaluation {
namespace {

using dataset::StampedLocalization;
using State = LocalizationState;

constexpr double kExact = 1e-12;

/// Truth: at rest in the origin from 0 to 900 ns. Only sums of 2 to 3 numbers occur: rounding errors only.
std::vector<dataset::StampedPose> restingTruth() {
  std::vector<dataset::StampedPose> truth;
  for (int i = 0; i < 10; ++i) truth.push_back({i * 100, Pose2{}});
  return truth;
}

StampedLocalization stateAt(TimeNs time_ns, State state, PoseEvent event = PoseEvent::kNone,
                            double sigmas = 0.0) {
  return {time_ns, state, event, sigmas};
}

TEST(LocalizationMetrics, GroupsErrorsByState) {
  const std::vector<StampedLocalization> rows{stateAt(0, State::kUnlocated), stateAt(100, State::kLocalized),
                                              stateAt(200, State::kLocalized),
                                              stateAt(300, State::kOdometryOnly), stateAt(400, State::kLost)};
  const std::vector<dataset::StampedPose> estimate{
      {100, Pose2{0.03, 0.04, 0.1}}, {200, Pose2{0.0, -0.01, -0.3}}, {300, Pose2{0.6, -0.8, 2.0}}};
  const LocalizationMetrics m = compareLocalization(rows, restingTruth(), estimate, 8);
  EXPECT_EQ(m.frames, 8);
  EXPECT_EQ(m.without_state, 3);
  ASSERT_EQ(m.states.size(), 5u);
  const StateMetrics& localized = m.states.at(State::kLocalized);
  EXPECT_EQ(localized.frames, 2);
  EXPECT_EQ(localized.poses, 2);
  EXPECT_NEAR(localized.share, 0.25, kExact);
  EXPECT_NEAR(localized.mean_m, 0.03, kExact);  // (0.05 + 0.01) / 2
  EXPECT_NEAR(localized.max_m, 0.05, kExact);
  EXPECT_NEAR(localized.mean_heading_rad, 0.2, kExact);
  EXPECT_NEAR(localized.max_heading_rad, 0.3, kExact);
  const StateMetrics& odometry = m.states.at(State::kOdometryOnly);
  EXPECT_NEAR(odometry.mean_m, 1.0, kExact);
  EXPECT_NEAR(odometry.max_heading_rad, 2.0, kExact);
  for (const State state : {State::kUnlocated, State::kLost, State::kRelocalized}) {
    EXPECT_EQ(m.states.at(state).frames, state == State::kRelocalized ? 0 : 1);
    EXPECT_EQ(m.states.at(state).poses, 0);
    EXPECT_TRUE(std::isnan(m.states.at(state).mean_m)) << "no pose";
    EXPECT_TRUE(std::isnan(m.states.at(state).max_heading_rad)) << "no pose";
  }
  EXPECT_TRUE(m.events.empty());
}

TEST(LocalizationMetrics, InterpolatesTruthAndWrapsHeadings) {
  const std::vector<dataset::StampedPose> truth{{0, Pose2{0, 0, 3.1}}, {100, Pose2{1, 0, 3.1}}};
  const std::vector<dataset::StampedPose> estimate{{25, Pose2{0.25, 0.5, -3.1}}, {150, Pose2{1, 0, 0}}};
  const LocalizationMetrics m = compareLocalization(
      {stateAt(25, State::kLocalized), stateAt(150, State::kLocalized)}, truth, estimate, 2);
  const StateMetrics& localized = m.states.at(State::kLocalized);
  EXPECT_EQ(localized.frames, 2);
  EXPECT_EQ(localized.poses, 1) << "the truth ends at 100 ns";
  EXPECT_NEAR(localized.max_m, 0.5, kExact);
  EXPECT_NEAR(localized.max_heading_rad, 2.0 * M_PI - 6.2, kExact);
}

TEST(LocalizationMetrics, CountsEventsAndLargestCorrection) {
  const LocalizationMetrics m = compareLocalization(
      {stateAt(0, State::kRelocalized, PoseEvent::kRelocalized, 20.0),
       stateAt(100, State::kLocalized, PoseEvent::kLoopClosed, 4.0),
       stateAt(200, State::kLocalized, PoseEvent::kLoopClosed, 6.5),
       stateAt(300, State::kLocalized, PoseEvent::kLoopClosed, 5.0), stateAt(400, State::kLocalized)},
      {}, {}, 5);
  ASSERT_EQ(m.events.size(), 2u);
  EXPECT_EQ(m.events.at(PoseEvent::kRelocalized).count, 1);
  EXPECT_EQ(m.events.at(PoseEvent::kRelocalized).largest_sigmas, 20.0);
  EXPECT_EQ(m.events.at(PoseEvent::kLoopClosed).count, 3);
  EXPECT_EQ(m.events.at(PoseEvent::kLoopClosed).largest_sigmas, 6.5);
  EXPECT_EQ(m.states.at(State::kLocalized).poses, 0) << "without truth and estimate";
}

TEST(LocalizationMetrics, RefersSharesToRowsIfRecordingHasFewerFrames) {
  const std::vector<StampedLocalization> rows{stateAt(0, State::kLost), stateAt(100, State::kLocalized),
                                              stateAt(200, State::kLocalized),
                                              stateAt(300, State::kLocalized)};
  for (const int frames : {0, 2}) {
    const LocalizationMetrics m = compareLocalization(rows, {}, {}, frames);
    EXPECT_EQ(m.frames, 4);
    EXPECT_EQ(m.without_state, 0);
    EXPECT_NEAR(m.states.at(State::kLost).share, 0.25, kExact);
  }
}

TEST(LocalizationMetrics, CountsFirstRowOfRepeatedTime) {
  const LocalizationMetrics m = compareLocalization(
      {stateAt(0, State::kLost), stateAt(0, State::kLocalized, PoseEvent::kCorrected, 5.0)}, {}, {}, 1);
  EXPECT_EQ(m.states.at(State::kLost).frames, 1);
  EXPECT_EQ(m.states.at(State::kLocalized).frames, 0);
  EXPECT_TRUE(m.events.empty());
}

TEST(LocalizationMetrics, HasNoSharesWithoutFrames) {
  const LocalizationMetrics m = compareLocalization({}, {}, {}, 0);
  EXPECT_EQ(m.frames, 0);
  EXPECT_EQ(m.states.size(), 5u);
  EXPECT_TRUE(std::isnan(m.states.at(State::kLocalized).share));
}

}  // namespace
}  // namespace omnifleet::evaluation
