// An external renderer's recording through the stages before the estimator, chained as in the services, in
// one process: images → local map → objects → poses, with and without the ceiling cameras. The truth is used
// only for comparison.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "dataset/ground_truth.h"
#include "recorded_line.h"
#include "tests/test_data.h"

namespace omnifleet::localizer::testing {
namespace {

class RecordedLine : public ::testing::Test {
 protected:
  void SetUp() override {
    OMNIFLEET_NEEDS_DATA(folder, "rendered_sample");
    data_ = dataset::Dataset::open(folder);
    truth_ = dataset::GroundTruth::load(folder).trajectories;
  }
  RecordedRun run(const estimation::EstimatorOptions& options, bool ceiling) {
    const RecordedRun result = runRecorded(data_, options, ceiling, truth_);
    std::printf("path: mean %.3f cm, worst %.3f cm, %.3f deg, NEES %.2f\n", 100 * result.mean_m,
                100 * result.worst_m, result.worst_rad * 180 / M_PI, result.nees);
    EXPECT_EQ(result.poses, 3 * 17);
    EXPECT_EQ(result.invalid, 0);
    return result;
  }
  dataset::Dataset data_;
  Truth truth_;
};

TEST_F(RecordedLine, IsAccurateToOneCentimetreWithoutCeilingCameras) {
  estimation::EstimatorOptions wheels;
  wheels.use_landmarks = wheels.use_sightings = false;
  const RecordedRun alone = run(wheels, false), all = run({}, false);
  EXPECT_LT(all.mean_m, 0.01);
  EXPECT_LT(all.mean_m, alone.mean_m);
  for (const auto& landmark : all.landmarks) {
    std::printf("landmark %u at %.3f %.3f height %.3f +- %.3f, %d views\n", landmark.id,
                landmark.centre_m.x(), landmark.centre_m.y(), landmark.height_m, landmark.height_sigma_m,
                landmark.views);
  }
}

/// Wrong calibrations: one centimetre of height, half a per cent of focal length, a third of a degree of
/// tilt.
TEST_F(RecordedLine, EstimatesCalibrationErrors) {
  std::map<std::string, estimation::CameraError> wrong;
  double sign = 1.0;
  for (auto& robot : data_.robots) {
    auto& camera = robot.fisheye->camera;
    const estimation::CameraError error =
        sign * (estimation::CameraError() << 0.005, 0.02, 0.006, -0.005, 0.0).finished();
    camera.focal_px *= 1.0 + error(0);
    camera.position_m.z() *= 1.0 + error(1);
    camera.rotation_rpy_deg.x() += error(2) * 180.0 / M_PI;
    camera.rotation_rpy_deg.y() += error(3) * 180.0 / M_PI;
    wrong[robot.name] = error;
    sign = -sign;
  }
  estimation::EstimatorOptions as_calibrated;
  as_calibrated.camera.estimate = false;
  const RecordedRun without_estimate = run(as_calibrated, false), estimated = run({}, false);
  EXPECT_LT(estimated.mean_m,
            0.6 * without_estimate.mean_m);  // outlines that misfit as a whole have less weight in it
  EXPECT_LT(estimated.mean_m, 0.0025);
  EXPECT_LT(estimated.nees, 5.7);  // 3 dof of 3 robots, hardly independent in time: 3 ± 2.6·√(6/9) at 99 %
  double tilt_error = 0.0, tilt_left = 0.0;
  for (const auto& [robot, error] : wrong) {
    const estimation::CameraError off = estimated.cameras.at(robot) - error;
    std::printf("%s (1e-3) wrong by %.1f %.1f %.1f %.1f, left %.1f %.1f %.1f %.1f\n", robot.c_str(),
                1e3 * error(0), 1e3 * error(1), 1e3 * error(2), 1e3 * error(3), 1e3 * off(0), 1e3 * off(1),
                1e3 * off(2), 1e3 * off(3));
    // Focal length and height (ten σ of the prior) have similar effects in 17 frames close to the robot. Only
    // their combined effect on the floor, two heights away, is observable. Each tilt is observable, though
    // what one robot happens to see may constrain one of them weakly.
    const auto radial = [](const estimation::CameraError& e) {
      return 2.0 * e(1) - 5.0 * std::atan(2.0) * e(0);
    };
    EXPECT_LT(std::abs(radial(off)), 0.8 * std::abs(radial(error))) << robot;
    for (int i = 2; i < 4; ++i) EXPECT_LT(std::abs(off(i)), 0.8 * std::abs(error(i))) << robot << " " << i;
    tilt_error += error.segment<2>(2).squaredNorm();
    tilt_left += off.segment<2>(2).squaredNorm();
  }
  EXPECT_LT(std::sqrt(tilt_left), 0.35 * std::sqrt(tilt_error));
}

TEST_F(RecordedLine, IsAccurateToTwoMillimetresWithCeilingCameras) {
  EXPECT_LT(run({}, true).mean_m, 0.002);
}

}  // namespace
}  // namespace omnifleet::localizer::testing
