// What a pose rests on, source by source, without a simulator.

#include "estimation/sources.h"

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "estimation/fleet_state.h"
#include "estimation/troubles.h"

namespace omnifleet::estimation {
namespace {

constexpr FactorId kSomeFactor = 7;
static_assert(kSomeFactor != kNoFactor);

SourceSet setOf(const std::vector<Source>& sources) {
  SourceSet set;
  for (const Source source : sources) set.add(source);
  return set;
}

struct SourceCase {
  std::string name;
  std::function<void(Step&, RobotNode&, RobotFrame&)> observe;
  std::vector<Source> used, rejected;
};

void measureByWheels(Step& step) {
  step.motion = kSomeFactor;
  step.wheels = true;
}

const std::vector<SourceCase>& sourceCases() {
  static const std::vector<SourceCase> kAll = {
      {"nothing", [](Step&, RobotNode&, RobotFrame&) {}, {}, {}},
      {"wheels", [](Step& s, RobotNode&, RobotFrame&) { measureByWheels(s); }, {Source::kWheels}, {}},
      {"wheels_that_slip",
       [](Step& s, RobotNode&, RobotFrame&) {
         measureByWheels(s);
         s.rejected = true;
       },
       {},
       {Source::kWheels}},
      {"floor_instead_of_wheels_that_slip",
       [](Step& s, RobotNode&, RobotFrame&) {
         measureByWheels(s);
         s.wheels_rejected = s.by_floor = true;
       },
       {Source::kFloor},
       {Source::kWheels}},
      {"floor_that_everything_else_contradicts",
       [](Step& s, RobotNode&, RobotFrame&) {
         s.motion = kSomeFactor;
         s.by_floor = s.rejected = true;
       },
       {},
       {Source::kFloor}},
      {"floor_beside_wheels_before_it_is_confirmed",
       [](Step& s, RobotNode&, RobotFrame&) {
         measureByWheels(s);
         s.floor = FloorStep{};
       },
       {Source::kWheels},
       {}},
      {"images_alone",
       [](Step& s, RobotNode&, RobotFrame&) {
         s.motion = kSomeFactor;
         s.by_appearance = true;
       },
       {Source::kAppearance},
       {}},
      {"compass_beside_wheels",
       [](Step& s, RobotNode&, RobotFrame&) {
         measureByWheels(s);
         s.compass = CompassTurn{};
       },
       {Source::kWheels, Source::kAppearance},
       {}},
      {"scan", [](Step& s, RobotNode&, RobotFrame&) { s.scan.factor = kSomeFactor; }, {Source::kScan}, {}},
      {"scan_found_by_the_search",
       [](Step& s, RobotNode&, RobotFrame&) { s.by_search = true; },
       {Source::kScan},
       {}},
      {"range_and_bearing_of_a_landmark",
       [](Step&, RobotNode& r, RobotFrame&) { r.absolute_aid.used.add(Source::kLandmarks); },
       {Source::kLandmarks},
       {}},
      {"scan_that_contradicts",
       [](Step&, RobotNode& r, RobotFrame&) { r.scan_aid.contradicted = true; },
       {},
       {Source::kScan}},
      {"landmarks_and_robots",
       [](Step& s, RobotNode&, RobotFrame&) {
         s.views.resize(2);
         s.views[0].landmark = 3;
       },
       {Source::kLandmarks, Source::kSightings},
       {}},
      {"views_that_misfit",
       [](Step&, RobotNode&, RobotFrame& f) {
         f.rejected.add(Source::kLandmarks);
         f.rejected.add(Source::kSightings);
       },
       {},
       {Source::kLandmarks, Source::kSightings}},
      {"absolute_measurement",
       [](Step&, RobotNode& r, RobotFrame&) { r.absolute_aid.used.add(Source::kAbsolute); },
       {Source::kAbsolute},
       {}},
      {"two_absolute_measurements_that_disagree",
       [](Step&, RobotNode& r, RobotFrame&) {
         r.absolute_aid.used.add(Source::kAbsolute);
         r.absolute_aid.rejected.add(Source::kAbsolute);
       },
       {Source::kAbsolute},
       {Source::kAbsolute}},
      {"initial_pose_at_its_frame",
       [](Step& s, RobotNode& r, RobotFrame&) {
         r.start.given = Pose2{};
         r.start.pose = s.pose;
       },
       {Source::kInitialPose},
       {}},
      {"initial_pose_later",
       [](Step& s, RobotNode& r, RobotFrame&) {
         r.start.given = Pose2{};
         r.start.pose = s.pose + 1;
       },
       {},
       {}},
      {"initial_pose_that_was_wrong",
       [](Step&, RobotNode& r, RobotFrame&) { r.start.contradicted = true; },
       {},
       {Source::kInitialPose}},
  };
  return kAll;
}

class PoseRestsOn : public testing::TestWithParam<SourceCase> {
 protected:
  PoseRestsOn() {
    EstimatorOptions options;
    options.appearance.with_wheels = true;
    RobotSetup setup;
    setup.name = "r1";
    fleet_ = std::make_unique<FleetState>(std::vector<RobotSetup>{setup}, options);
    robot_ = &fleet_->robots[0];
  }

  std::unique_ptr<FleetState> fleet_;
  RobotNode* robot_ = nullptr;
  Objects objects_;
};

TEST_P(PoseRestsOn, WhatWasUsedAndNotOnWhatWasRejected) {
  robot_->window.emplace_back().pose = 5;
  RobotFrame frame{&objects_, robot_, true, {}};
  GetParam().observe(robot_->window.back(), *robot_, frame);
  const PoseSources sources = sourcesOf(*fleet_, frame);
  EXPECT_EQ(sources.used.bits, setOf(GetParam().used).bits);
  EXPECT_EQ(sources.rejected.bits, setOf(GetParam().rejected).bits);
}

TEST_P(PoseRestsOn, NothingWithoutAPoseOrANewFrame) {
  RobotFrame frame{&objects_, robot_, true, {}};
  Step unplaced;
  GetParam().observe(unplaced, *robot_, frame);
  EXPECT_EQ(sourcesOf(*fleet_, frame).used.bits, 0) << "unlocated";
  robot_->window.push_back(std::move(unplaced));
  frame.fresh = false;
  EXPECT_EQ(sourcesOf(*fleet_, frame).used.bits, 0);
  EXPECT_EQ(sourcesOf(*fleet_, frame).rejected.bits, 0);
}

INSTANTIATE_TEST_SUITE_P(Sources, PoseRestsOn, testing::ValuesIn(sourceCases()),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace omnifleet::estimation
