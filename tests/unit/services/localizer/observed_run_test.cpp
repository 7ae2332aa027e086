#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "dataset/ground_truth.h"
#include "evaluation/consistency.h"
#include "evaluation/trajectory_metrics.h"
#include "observed_fleet.h"
#include "observed_run.h"

namespace omnifleet::localizer::testing {
namespace {

double worst(const ObservedRun& run, const ObservedFleet& fleet, const std::string& robot,
             double from_s = 0.0) {
  double largest = 0.0;
  const auto& truth = fleet.truth.at(robot);
  for (const auto& pose : run.trajectories.at(robot)) {
    Pose2 exact;
    if (static_cast<double>(pose.time_ns - truth.front().time_ns) * 1e-9 < from_s) continue;
    if (!evaluation::poseAt(truth, pose.time_ns, 1'000'000'000, exact)) continue;
    largest = std::max(largest, (pose.map_from_base.translation() - exact.translation()).norm());
  }
  return largest;
}

double meanError(const ObservedRun& run, const ObservedFleet& fleet) {
  double sum = 0.0;
  for (const auto& [name, path] : run.trajectories)
    sum += evaluation::comparePaths(fleet.truth.at(name), path).distance_m;
  return sum / static_cast<double>(run.trajectories.size());
}

/// Mean distance to the truth after the whole run was aligned with it.
double alignedError(ObservedRun run, const ObservedFleet& fleet) {
  const Pose2 truth_from_map = alignToTruth(run, fleet.truth);
  for (auto& [name, path] : run.trajectories) {
    for (auto& pose : path) pose.map_from_base = truth_from_map * pose.map_from_base;
  }
  return meanError(run, fleet);
}

double landmarkError(const ObservedRun& run, const ObservedFleet& fleet) {
  double sum = 0.0;
  for (const auto& point : run.points) {
    for (const auto& landmark : fleet.recording.landmarks) {
      if (landmark.name == point.name) sum += (landmark.position_m - point.position_m).norm();
    }
  }
  return sum / static_cast<double>(run.points.size());
}

ObservedRun runOf(const ObservedFleet& fleet, bool survey) {
  ObservedRunOptions options;
  options.survey = survey;
  return runObserved(fleet.recording, options, fleet.truth);
}

TEST(ObservedFleet, IsLocalizedConsistentlyOverSeeds) {
  // NEES of three degrees of freedom: 3 on average if the covariance is consistent. Errors of successive
  // poses are correlated: of 30 s and 3 robots about 20 are independent, of four seeds 80. Their mean lies
  // within 3 ± 2.6·√(6/80) = 2.3 … 3.7 in 99 % of the cases. The position random walk that the estimator
  // assumes and the simulation lacks makes it smaller.
  for (const bool survey : {true, false}) {
    double nees = 0.0, error = 0.0;
    int runs = 0;
    for (std::uint32_t seed = 1000; seed < 1004; ++seed) {
      ObservedFleetOptions options;
      options.duration_s = 30.0;
      const ObservedFleet fleet(options, seed);
      const ObservedRun run = runOf(fleet, survey);
      error += meanError(run, fleet) / 4.0;
      for (const auto& [name, value] : run.nees) nees += value, ++runs;
    }
    nees /= runs;
    std::printf("%s landmarks: mean %.3f m, NEES %.2f\n", survey ? "known" : "unknown", error, nees);
    EXPECT_GT(nees, 0.7);
    EXPECT_LT(nees, 3.7);
    EXPECT_LT(error, survey ? 0.05 : 0.08);  // the error of a range is 4 cm + 2 % at up to 4 m
  }
}

TEST(ObservedFleet, SensorErrorsAreEstimated) {
  ObservedFleetOptions options;
  options.delay_s = 0.2;
  options.obliqueness = 1.0;
  options.bearing_bias_rad = -0.03;
  options.outliers = 0.02;
  const ObservedFleet fleet(options, 1005);
  const ObservedRun run = runOf(fleet, true);
  double delay_off_s = 0.0;
  for (const auto& [name, detector] : run.detectors) {
    // On circles a delay and a bearing bias are hardly distinguishable: the estimate must be nearer to the
    // truth than no estimate.
    EXPECT_NEAR(detector(0), -0.03, 0.03) << name;
    const double off_s = std::abs(run.wheels.at(name)(3) - options.delay_s);
    EXPECT_LT(off_s, options.delay_s) << name;
    delay_off_s += off_s / 3.0;
    EXPECT_NEAR(detector(3), 1.0, 0.2) << name;  // (1 − cos 0.5) is 0.12: 2 cm of 4 m are 0.04 of it
  }
  EXPECT_LT(delay_off_s, 0.12);  // 0.2 if nothing is estimated
  EXPECT_LT(meanError(run, fleet), 0.08);
}

// As on real robots (MRCLAM): depth along an axis that differs from that of base_link, from a delayed camera
// in front of the axle. If the axis is assumed to be exact, every heading is off by the same angle.
TEST(ObservedFleet, MisalignedCameraAxisDoesNotBiasHeading) {
  ObservedFleetOptions options;
  options.obliqueness = 1.0;
  options.axis_rad = -0.05;
  options.mounting_m = 0.05;
  options.lag_s = 0.05;
  double heading = 0.0, assumed_exact = 0.0;
  std::vector<evaluation::Consistency> all;
  for (std::uint32_t seed = 1008; seed < 1011; ++seed) {
    const ObservedFleet fleet(options, seed);
    ObservedRunOptions run_options;
    run_options.survey = true;
    const ObservedRun run = runObserved(fleet.recording, run_options, fleet.truth);
    run_options.estimator.detector.axis_sigma_rad = 1e-6;
    const ObservedRun exact = runObserved(fleet.recording, run_options, fleet.truth);
    std::vector<evaluation::EstimatedPath> estimated_paths;
    for (const auto& [name, path] : run.trajectories) {
      heading += evaluation::comparePaths(fleet.truth.at(name), path).heading_rad / 9.0;
      assumed_exact +=
          evaluation::comparePaths(fleet.truth.at(name), exact.trajectories.at(name)).heading_rad / 9.0;
      estimated_paths.push_back({fleet.truth.at(name), path, run.covariances.at(name)});
    }
    all.push_back(evaluation::checkFleet(estimated_paths));
  }
  const evaluation::Consistency consistency = evaluation::pooled(all);
  std::printf("heading %.4f rad, %.4f with the axis assumed exact; NEES %.2f, %.1f %% inside\n", heading,
              assumed_exact, consistency.mean, 100.0 * consistency.inside);
  EXPECT_LT(heading, 0.02);
  EXPECT_LT(heading, 0.8 * assumed_exact);
  EXPECT_LT(consistency.mean, consistency.bounds.upper);
  EXPECT_GT(consistency.inside, 0.9);
}

TEST(ObservedFleet, IsLocalizedWithoutInitialPoses) {
  ObservedFleetOptions options;
  options.initial_poses = false;
  const ObservedFleet fleet(options, 1006);
  const ObservedRun run = runOf(fleet, true);
  ASSERT_EQ(run.trajectories.size(), 3U);
  for (const auto& [name, path] : run.trajectories) {
    EXPECT_GT(path.size(), 100U) << name;  // of 240 reports, some before there are enough observations
    EXPECT_LT(worst(run, fleet, name), 0.6) << name;
    EXPECT_LT(worst(run, fleet, name, 30.0), 0.2) << name;
  }
}

double largestHeadingSigma(const ObservedRun& run) {
  double largest = 0.0;
  for (const auto& [name, covariances] : run.covariances)
    largest = std::max(largest, std::sqrt(covariances.back().covariance(2, 2)));
  return largest;
}

// Without initial poses `map` is defined by the points, as accurately as these are known relative to each
// other.
TEST(ObservedFleet, MapWithoutInitialPosesIsDefinedByItsPoints) {
  ObservedFleetOptions fleet_options;
  fleet_options.initial_poses = false;
  const ObservedFleet fleet(fleet_options, 1017);
  ObservedRunOptions options;
  options.estimator.initial_sigma_rad = 0.2;
  const ObservedRun run = runObserved(fleet.recording, options, fleet.truth);
  ASSERT_EQ(run.covariances.size(), 3U);
  EXPECT_EQ(run.covariances.at("r1").front().datum, 1U) << "datum: its own initial pose";
  for (const auto& entry : run.covariances) EXPECT_EQ(entry.second.back().datum, 2U) << "datum: the points";
  EXPECT_LT(largestHeadingSigma(run), 0.05);
  EXPECT_LT(alignedError(run, fleet), 0.06);  // the error of a range is 4 cm + 2 % at up to 4 m
}

TEST(ObservedFleet, KidnappedRobotIsReportedAndMapStaysIntact) {
  ObservedFleetOptions options;
  const ObservedFleet undisturbed(options, 1007);
  options.kidnapped_s = 30.0;
  const ObservedFleet fleet(options, 1007);
  const ObservedRun run = runOf(fleet, false);
  EXPECT_EQ(run.status.at("r1").losses, 1);
  EXPECT_EQ(run.status.at("r2").losses, 0);
  EXPECT_EQ(run.status.at("r3").losses, 0);
  EXPECT_EQ(run.status.at("r1").state, estimation::RobotState::kOk);  // it was relocalized
  // The map is as accurate as without the kidnapping.
  EXPECT_LT(landmarkError(run, fleet), landmarkError(runOf(undisturbed, false), undisturbed) + 0.03);
  EXPECT_LT(worst(run, fleet, "r1", 45.0), 0.4);
  int wrong = 0;
  for (const auto& pose : run.trajectories.at("r1")) {
    Pose2 exact;
    evaluation::poseAt(fleet.truth.at("r1"), pose.time_ns, 1'000'000'000, exact);
    wrong += (pose.map_from_base.translation() - exact.translation()).norm() > 1.0 ? 1 : 0;
  }
  EXPECT_LE(wrong, 8);  // two seconds until three observations in a row have been rejected
}

}  // namespace
}  // namespace omnifleet::localizer::testing
