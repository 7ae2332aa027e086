// What people are told of cameras: nothing of exact ones, however outlines err; of wrong ones what is wrong,
// and what stops being borne out is taken back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

using testing::FleetSimulator;
using testing::SimulationOptions;

/// One run; frames may come from several simulators in turn, which drive the same way.
class Drive {
 public:
  explicit Drive(FleetSimulator& simulator, const EstimatorOptions& options = {})
      : estimator_(simulator.setups(), options) {}

  void feed(FleetSimulator& simulator, int frame) {
    const std::vector<Objects> frames = simulator.frames(frame);
    estimator_.process(simulator.time(frame), testing::pointers(frames), {});
    hear();
  }
  void finish() {
    estimator_.finish();
    hear();
  }
  int accused() const { return count("minus estimate"); }
  int takenBack() const { return count("withdrawn"); }
  const FleetEstimator& estimator() const { return estimator_; }

 private:
  void hear() {
    for (Message& message : estimator_.takeFindings()) {
      std::printf("  %s\n", toLogLine(message).c_str());
      heard_.push_back(std::move(message));
    }
  }
  int count(const char* what) const {
    return static_cast<int>(std::count_if(heard_.begin(), heard_.end(), [&](const Message& message) {
      return message.code == ErrorCode::kCalibrationError && message.text.find(what) != std::string::npos;
    }));
  }

  FleetEstimator estimator_;
  std::vector<Message> heard_;
};

TEST(Accused, NoExactCameraWhereThingsHaveADarkSide) {
  for (std::uint32_t seed = 21; seed < 25; ++seed) {
    SimulationOptions shaded;
    shaded.dark_side_m = 0.02;
    FleetSimulator simulator(shaded, seed);
    Drive run(simulator);
    for (int i = 0; i < shaded.frames; ++i) run.feed(simulator, i);
    run.finish();
    EXPECT_EQ(run.accused(), 0) << "seed " << seed;
  }
}

/// Nobody else sees what a lone robot sees, so nothing ever confirms its start.
TEST(Accused, NoExactCameraOfALoneRobotEither) {
  for (std::uint32_t seed = 21; seed < 25; ++seed) {
    SimulationOptions shaded;
    shaded.dark_side_m = 0.02;
    shaded.robots = 1;
    shaded.frames = 75;
    FleetSimulator simulator(shaded, seed);
    Drive run(simulator);
    for (int i = 0; i < shaded.frames; ++i) run.feed(simulator, i);
    run.finish();
    EXPECT_EQ(run.accused(), 0) << "seed " << seed;
  }
}

TEST(Accused, AWrongCameraIsToldWithAnHonestSigma) {
  double squares = 0.0;
  int told = 0, quantities = 0;
  for (std::uint32_t seed = 21; seed < 24; ++seed) {
    SimulationOptions flawed;
    flawed.camera_sigma = Eigen::Vector4d(0.006, 0.0, 0.0035, 0.0035);  // first order holds
    FleetSimulator simulator(flawed, seed);
    Drive run(simulator);
    for (int i = 0; i < flawed.frames; ++i) run.feed(simulator, i);
    run.finish();
    told += run.accused();
    EXPECT_EQ(run.takenBack(), 0);
    for (int robot = 0; robot < flawed.robots; ++robot) {
      const std::string name = FleetSimulator::name(robot);
      const CameraFinding finding(run.estimator().cameraError(name), run.estimator().cameraCovariance(name),
                                  {});
      for (const int i : {0, 2, 3}) {
        squares += std::pow(finding.deviation(i, simulator.cameraError(robot)(i)), 2);
        ++quantities;
      }
    }
  }
  std::printf("rms %.2f sigma over %d quantities\n", std::sqrt(squares / quantities), quantities);
  EXPECT_GE(told, 9);
  EXPECT_LT(std::sqrt(squares / quantities), 1.5);
}

/// A ruler was held elsewhere, for all robots alike: a centimetre of fifty, ten times what heights are
/// usually off by.
TEST(Accused, AHeightFarOffIsFound) {
  double errors = 0.0;
  int robots = 0;
  for (const double off : {0.02, -0.02}) {
    for (std::uint32_t seed = 21; seed < 23; ++seed) {
      SimulationOptions flawed;
      flawed.too_high = off;
      FleetSimulator simulator(flawed, seed);
      Drive run(simulator);
      for (int i = 0; i < flawed.frames; ++i) run.feed(simulator, i);
      run.finish();
      for (int robot = 0; robot < flawed.robots; ++robot, ++robots)
        errors += std::abs(run.estimator().cameraError(FleetSimulator::name(robot))(1) - off);
    }
  }
  std::printf("%.4f of the height\n", errors / robots);
  EXPECT_LT(errors / robots, 0.005);
}

/// Somebody mends the camera while the fleet drives: nothing else makes an accusation that large wrong.
TEST(Accused, WhatIsNotBorneOutIsTakenBack) {
  constexpr std::uint32_t kSeed = 22;
  SimulationOptions exact, flawed;
  exact.frames = flawed.frames = 240;
  flawed.camera_sigma = Eigen::Vector4d(0.008, 0.0, 0.0, 0.0);
  FleetSimulator before(flawed, kSeed), after(exact, kSeed);
  Drive run(before);
  int frame = 0;
  for (; frame < 100 && run.accused() == 0; ++frame) {
    run.feed(before, frame);
    after.frames(frame);
  }
  ASSERT_GT(run.accused(), 0);
  EXPECT_GT(frame, 15);  // not before it has lasted for half a metre, 15 keyframes
  EXPECT_EQ(run.takenBack(), 0);
  for (; frame < exact.frames; ++frame) run.feed(after, frame);
  run.finish();
  EXPECT_GT(run.takenBack(), 0);
}

}  // namespace
}  // namespace omnifleet::estimation
