// Reports of calibration errors: none of exact cameras with wrong outlines, the wrong quantities of wrong
// cameras, and withdrawal if later observations contradict the report.
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

/// One run; its frames may come from several simulators, which drive the same paths.
class CalibrationRun {
 public:
  explicit CalibrationRun(FleetSimulator& simulator, const EstimatorOptions& options = {})
      : estimator_(simulator.setups(), options) {}

  void feed(FleetSimulator& simulator, int frame) {
    const std::vector<Objects> frames = simulator.frames(frame);
    estimator_.process(simulator.time(frame), testing::pointers(frames), {});
    collect();
  }
  void finish() {
    estimator_.finish();
    collect();
  }
  int reports() const { return count("minus estimate"); }
  int withdrawals() const { return count("withdrawn"); }
  const FleetEstimator& estimator() const { return estimator_; }

 private:
  void collect() {
    for (Message& message : estimator_.takeFindings()) {
      std::printf("  %s\n", toLogLine(message).c_str());
      messages_.push_back(std::move(message));
    }
  }
  int count(const char* what) const {
    return static_cast<int>(std::count_if(messages_.begin(), messages_.end(), [&](const Message& message) {
      return message.code == ErrorCode::kCalibrationError && message.text.find(what) != std::string::npos;
    }));
  }

  FleetEstimator estimator_;
  std::vector<Message> messages_;
};

TEST(CameraCalibration, ExactCameraIsNotReportedDespiteShadows) {
  for (std::uint32_t seed = 21; seed < 25; ++seed) {
    SimulationOptions shadows;
    shadows.shadow_m = 0.02;
    FleetSimulator simulator(shadows, seed);
    CalibrationRun run(simulator);
    for (int i = 0; i < shadows.frames; ++i) run.feed(simulator, i);
    run.finish();
    EXPECT_EQ(run.reports(), 0) << "seed " << seed;
  }
}

/// No other robot confirms the initial pose of a lone robot.
TEST(CameraCalibration, ExactCameraOfALoneRobotIsNotReportedDespiteShadows) {
  for (std::uint32_t seed = 21; seed < 25; ++seed) {
    SimulationOptions shadows;
    shadows.shadow_m = 0.02;
    shadows.robots = 1;
    shadows.frames = 75;
    FleetSimulator simulator(shadows, seed);
    CalibrationRun run(simulator);
    for (int i = 0; i < shadows.frames; ++i) run.feed(simulator, i);
    run.finish();
    EXPECT_EQ(run.reports(), 0) << "seed " << seed;
  }
}

TEST(CameraCalibration, ErrorsAreReportedWithConsistentSigma) {
  double squares = 0.0;
  int reports = 0, quantities = 0;
  for (std::uint32_t seed = 21; seed < 24; ++seed) {
    SimulationOptions flawed;
    flawed.camera_sigma = Eigen::Vector4d(0.006, 0.0, 0.0035, 0.0035);  // first order holds
    FleetSimulator simulator(flawed, seed);
    CalibrationRun run(simulator);
    for (int i = 0; i < flawed.frames; ++i) run.feed(simulator, i);
    run.finish();
    reports += run.reports();
    EXPECT_EQ(run.withdrawals(), 0);
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
  EXPECT_GE(reports, 9);
  EXPECT_LT(std::sqrt(squares / quantities), 1.5);
}

/// All heights err by the same centimetre of 50 cm, ten times the usual error.
TEST(CameraCalibration, HeightErrorOfTwoPercentIsEstimated) {
  double errors = 0.0;
  int robots = 0;
  for (const double error : {0.02, -0.02}) {
    for (std::uint32_t seed = 21; seed < 23; ++seed) {
      SimulationOptions flawed;
      flawed.height_error = error;
      FleetSimulator simulator(flawed, seed);
      CalibrationRun run(simulator);
      for (int i = 0; i < flawed.frames; ++i) run.feed(simulator, i);
      run.finish();
      for (int robot = 0; robot < flawed.robots; ++robot, ++robots)
        errors += std::abs(run.estimator().cameraError(FleetSimulator::name(robot))(1) - error);
    }
  }
  std::printf("%.4f of the height\n", errors / robots);
  EXPECT_LT(errors / robots, 0.005);
}

/// The calibration is corrected while the fleet drives.
TEST(CameraCalibration, ReportIsWithdrawnAfterCorrection) {
  constexpr std::uint32_t kSeed = 22;
  SimulationOptions exact, flawed;
  exact.frames = flawed.frames = 240;
  flawed.camera_sigma = Eigen::Vector4d(0.008, 0.0, 0.0, 0.0);
  FleetSimulator before(flawed, kSeed), after(exact, kSeed);
  CalibrationRun run(before);
  int frame = 0;
  for (; frame < 100 && run.reports() == 0; ++frame) {
    run.feed(before, frame);
    after.frames(frame);
  }
  ASSERT_GT(run.reports(), 0);
  EXPECT_GT(frame, 15);  // the error must persist for 0.5 m, 15 keyframes
  EXPECT_EQ(run.withdrawals(), 0);
  for (; frame < exact.frames; ++frame) run.feed(after, frame);
  run.finish();
  EXPECT_GT(run.withdrawals(), 0);
}

}  // namespace
}  // namespace omnifleet::estimation
