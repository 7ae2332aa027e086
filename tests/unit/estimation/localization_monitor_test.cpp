#include "estimation/localization_monitor.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace omnifleet::estimation {
namespace {

using State = LocalizationState;

constexpr LocalizationEvidence kConfirmed{true, true, true, false, false, 0.01};
constexpr LocalizationEvidence kOdometry{true, true, false, false, false, 0.01};
constexpr LocalizationEvidence kContradicted{true, true, false, true, false, 0.01};
constexpr LocalizationEvidence kFound{true, true, false, false, true, 0.01};
constexpr LocalizationEvidence kBlindAndFar{true, false, false, false, false, 2.0};
constexpr LocalizationEvidence kBlindAndNear{true, false, false, false, false, 0.1};
/// After a gap in which nothing was measured: what it observes agrees with a pose that may be far off.
constexpr LocalizationEvidence kConfirmedAndFar{true, true, true, false, false, 8.0};
constexpr LocalizationEvidence kReleased{false, true, false, false, false, 2.0};

struct Transition {
  std::string name;
  std::vector<LocalizationEvidence> before;
  LocalizationEvidence evidence;
  State expected;
};

std::vector<LocalizationEvidence> times(std::size_t n, const LocalizationEvidence& evidence) {
  return std::vector<LocalizationEvidence>(n, evidence);
}

std::vector<LocalizationEvidence> then(std::vector<LocalizationEvidence> first,
                                       const std::vector<LocalizationEvidence>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

const std::vector<Transition>& transitions() {
  static const std::vector<Transition> kAll = {
      {"unlocated_without_pose", {}, kReleased, State::kUnlocated},
      {"unlocated_to_localized_by_first_pose", {}, kOdometry, State::kLocalized},
      {"localized_while_confirmed", times(9, kConfirmed), kConfirmed, State::kLocalized},
      {"localized_over_a_short_gap", then({kConfirmed}, times(3, kOdometry)), kOdometry, State::kLocalized},
      {"localized_to_odometry_only", then({kConfirmed}, times(4, kOdometry)), kOdometry,
       State::kOdometryOnly},
      {"contradicted_to_odometry_only", then({kConfirmed}, times(4, kContradicted)), kContradicted,
       State::kOdometryOnly},
      {"odometry_only_never_lost_with_odometry", then({kConfirmed}, times(999, kOdometry)), kOdometry,
       State::kOdometryOnly},
      {"odometry_only_to_localized", then({kConfirmed}, times(9, kOdometry)), kConfirmed, State::kLocalized},
      {"blind_without_odometry_stays_near", then({kConfirmed}, times(9, kBlindAndNear)), kBlindAndNear,
       State::kOdometryOnly},
      {"blind_without_odometry_to_lost", then({kConfirmed}, times(9, kBlindAndNear)), kBlindAndFar,
       State::kLost},
      {"lost_stays_lost_when_odometry_returns", then({kConfirmed}, times(9, kBlindAndFar)), kOdometry,
       State::kLost},
      {"lost_to_relocalized", then({kConfirmed}, times(9, kBlindAndFar)), kFound, State::kRelocalized},
      {"lost_to_relocalized_by_observations", then({kConfirmed}, times(9, kBlindAndFar)), kConfirmed,
       State::kRelocalized},
      {"first_pose_after_a_gap_is_not_localized", {}, kConfirmedAndFar, State::kOdometryOnly},
      {"not_localized_while_the_pose_is_uncertain", times(9, kConfirmedAndFar), kConfirmedAndFar,
       State::kOdometryOnly},
      {"relocalized_once_the_pose_is_certain", times(9, kConfirmedAndFar), kConfirmed, State::kRelocalized},
      {"localized_after_that", then(times(9, kConfirmedAndFar), {kConfirmed}), kConfirmed, State::kLocalized},
      {"lost_while_the_pose_is_uncertain", times(9, kBlindAndFar), kConfirmedAndFar, State::kLost},
      {"localized_stays_so_with_growing_sigma", {kConfirmed}, kConfirmedAndFar, State::kLocalized},
      {"released_is_lost", {kConfirmed}, kReleased, State::kLost},
      {"odometry_only_to_relocalized", then({kConfirmed}, times(9, kContradicted)), kFound,
       State::kRelocalized},
      {"relocalized_to_localized", {kConfirmed, kFound}, kConfirmed, State::kLocalized},
      {"relocalized_for_one_frame", {kConfirmed, kFound}, kOdometry, State::kLocalized},
  };
  return kAll;
}

class Transitions : public ::testing::TestWithParam<std::size_t> {};

TEST_P(Transitions, FollowTheTable) {
  const Transition& row = transitions()[GetParam()];
  LocalizationMonitor monitor;
  for (const LocalizationEvidence& evidence : row.before) monitor.update(evidence);
  EXPECT_EQ(monitor.update(row.evidence), row.expected) << row.name << ": " << toString(monitor.state());
}

INSTANTIATE_TEST_SUITE_P(LocalizationMonitor, Transitions, ::testing::Range<std::size_t>(0, 23),
                         [](const auto& row) { return transitions()[row.param].name; });

TEST(LocalizationMonitor, DoubtLastsUntilThePoseIsConfirmed) {
  LocalizationMonitor monitor;
  for (int i = 0; i < 4; ++i) monitor.update(kContradicted);
  EXPECT_FALSE(monitor.isInDoubt());
  monitor.update(kContradicted);
  EXPECT_TRUE(monitor.isInDoubt());
  for (int i = 0; i < 9; ++i) monitor.update(kOdometry);
  EXPECT_TRUE(monitor.isInDoubt()) << "odometry alone is no confirmation";
  monitor.update(kConfirmed);
  EXPECT_FALSE(monitor.isInDoubt());
}

}  // namespace
}  // namespace omnifleet::estimation
