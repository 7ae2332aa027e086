// Objects that seem to reject the wheels, and the floor's boundary in a room: consecutive scans decide.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "tests/unit/scan/room_scans.h"
#include "tests/unit/services/classifier/scenario.h"

namespace omnifleet::sim {
namespace {

using classifier::Classifier;

constexpr double kInverseSigma = 0.003;  // 1/m, of the boundary
constexpr int kChange = 20;              // frame in which something changes, …
constexpr int kLast = 24;                // … and the last frame

/// A robot drives slowly past three objects in a furnished room; what a test does to one frame.
struct StepInScene {
  bool in_room = true;  ///< the local maps have a boundary
  std::function<void(Scene&)> change = [](Scene&) {};
  std::function<void(LocalMap&)> garble = [](LocalMap&) {};
};

struct StepResult {
  Motion given, used;  ///< of frame kChange
  Pose2 truth;
  bool isGiven() const {
    return used.valid == given.valid && !used.wheels_rejected &&
           used.previous_from_current.vector() == given.previous_from_current.vector();
  }
};

/// The objects of the scene are small and stand free; the boundary shows the room alone.
StepResult runStep(const StepInScene& step) {
  std::mt19937 random(11);
  Scene scene, before;
  scene.bodies = {sim::round("r1", 0.15, 0.3, {-0.6, -0.2, 0.1}), box("a", 0.25, 0.2, 0.2, {0.5, 0.5, 0.4}),
                  box("b", 0.2, 0.3, 0.2, {0.6, -0.7, 1.0}), box("c", 0.2, 0.15, 0.2, {-0.2, -1.2, 0.2})};
  scene.bodies.front().robot = true;
  scene.bodies.front().v_mps = 0.2;
  const scan::testing::Scene room = scan::testing::furnishedRoom();
  Classifier classifier({}, "r1", {{"r1", RobotBody{}}});
  StepResult result;
  for (int frame = 0; frame <= kLast; ++frame) {
    if (frame == kChange) step.change(scene);
    LocalMap map = localMapOf(scene, 0, frame > 0 ? &before : nullptr, frame, random);
    if (step.in_room) map.boundary = room.scan(scene.bodies[0].pose, kInverseSigma, random, 360);
    if (frame == kChange) step.garble(map);
    const Objects& objects = classifier.process(map, {});
    if (frame == kChange)
      result = {map.motion, objects.motion, before.bodies[0].pose.inverse() * scene.bodies[0].pose};
    before = scene;
    scene.advance();
  }
  return result;
}

/// As if the robot had moved by the inverse.
void moveObjects(Scene& scene, const Pose2& by) {
  for (std::size_t i = 1; i < scene.bodies.size(); ++i) {
    const Pose2& robot = scene.bodies[0].pose;
    scene.bodies[i].pose = robot * by * robot.inverse() * scene.bodies[i].pose;
  }
}

double offTruth(const StepResult& result) {
  return (result.truth.inverse() * result.used.previous_from_current).translation().norm();
}

const Pose2 kLeap{-0.18, 0.06, 0.1};

TEST(StepScans, ConfirmWheelsThatObjectsSeemToReject) {
  StepInScene step;
  step.change = [](Scene& scene) { moveObjects(scene, kLeap); };
  EXPECT_TRUE(runStep(step).isGiven());
  step.in_room = false;
  const StepResult by_objects = runStep(step);
  EXPECT_TRUE(by_objects.used.wheels_rejected) << "the objects alone reject them";
  EXPECT_GT(offTruth(by_objects), 0.1);
}

TEST(StepScans, RejectWheelsThatObjectsReject) {
  StepInScene step;
  step.garble = [](LocalMap& map) { map.motion.previous_from_current.x_m += 0.25; };
  for (const bool in_room : {true, false}) {
    step.in_room = in_room;
    const StepResult result = runStep(step);
    EXPECT_TRUE(result.used.wheels_rejected && result.used.valid) << in_room;
    EXPECT_LT(offTruth(result), 0.03) << in_room;
  }
}

TEST(StepScans, LeaveTheWheelsWhereObjectsSayAnotherMotion) {
  // Wheels and objects are both wrong: nothing confirms the objects' motion.
  StepInScene step;
  step.change = [](Scene& scene) { moveObjects(scene, kLeap); };
  step.garble = [](LocalMap& map) { map.motion.previous_from_current.y_m += 0.3; };
  EXPECT_TRUE(runStep(step).isGiven());
  step.in_room = false;
  EXPECT_TRUE(runStep(step).used.wheels_rejected);
}

TEST(StepScans, DoNotDecideWithoutTheFrameBefore) {
  // The boundary begins with the changed frame: the objects decide.
  StepInScene step;
  step.in_room = false;
  step.change = [](Scene& scene) { moveObjects(scene, kLeap); };
  step.garble = [](LocalMap& map) {
    std::mt19937 random(12);
    map.boundary = scan::testing::furnishedRoom().scan({-0.2, -0.2, 0.1}, kInverseSigma, random, 360);
  };
  EXPECT_TRUE(runStep(step).used.wheels_rejected);
}

/// The wheels leap by 1 m, and no object is where any motion would put it.
TEST(StepScans, MostlyObjectsInSightMakeALeapUnknown) {
  StepInScene step;
  std::uint16_t label = 0;
  step.garble = [&](LocalMap& map) {
    map.motion.previous_from_current.x_m += 1.0;
    map.objects.clear();
    if (label != 0) map.scan.object.assign(map.scan.object.size(), label);
  };
  EXPECT_TRUE(runStep(step).isGiven()) << "the boundary shows walls: what was seen need not be objects";
  label = 1;
  EXPECT_FALSE(runStep(step).used.valid) << "all beams end at objects";
  step.in_room = false;
  EXPECT_FALSE(runStep(step).used.valid) << "no boundary";
}

TEST(StepScans, ConfirmALeapThatNoObjectShows) {
  StepInScene step;
  step.change = [](Scene& scene) { scene.bodies[0].pose = scene.bodies[0].pose * Pose2{0.6, 0.0, 0.0}; };
  step.garble = [](LocalMap& map) {
    map.objects.clear();
    map.scan.object.assign(map.scan.object.size(), 1);  // all beams end at objects
  };
  EXPECT_TRUE(runStep(step).isGiven());
  step.in_room = false;
  EXPECT_FALSE(runStep(step).used.valid);
}

/// A robot that may have sped up for three seconds is not where its last speed would put it.
TEST(StepScans, TheLastSpeedRejectsNoWheelsAfterALongStep) {
  StepInScene step;
  step.in_room = false;
  TimeNs later_ns = 0;
  step.change = [](Scene& scene) { scene.bodies[0].pose = scene.bodies[0].pose * Pose2{0.6, 0.0, 0.0}; };
  step.garble = [&](LocalMap& map) {
    map.acquired_ns += later_ns;
    map.objects.clear();
    map.scan.object.assign(map.scan.object.size(), 1);  // all beams end at objects
  };
  EXPECT_FALSE(runStep(step).used.valid) << "0.6 m from one frame to the next";
  later_ns = 3000000000;
  EXPECT_TRUE(runStep(step).isGiven()) << "0.6 m in three seconds";
}

}  // namespace
}  // namespace omnifleet::sim
