#include "estimation/estimator.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

using testing::FleetSimulator;
using testing::pointers;
using testing::run;
using testing::RunResult;
using testing::SimulationOptions;

constexpr std::uint32_t kFirstSeed = 1000, kSeeds = 2;  // estimation_seeds runs all of 1000–1099

/// Of calibrations: 0.3 % of the focal length, 2 mm of the height, 0.2° of roll and pitch.
const Eigen::Vector4d kFlaw(0.003, 0.004, 0.0035, 0.0035);

RunResult average(const SimulationOptions& simulation, const EstimatorOptions& options = {}) {
  RunResult sum;
  for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    const RunResult r = run(simulation, options, seed);
    sum.mean_m += r.mean_m / kSeeds;
    sum.nees += r.nees / kSeeds;
    sum.camera += r.camera / kSeeds;
    sum.worst_m = std::max(sum.worst_m, r.worst_m);
    sum.landmark_m += r.landmark_m / kSeeds;
    sum.landmarks += r.landmarks;
    sum.estimates += r.estimates;
    sum.frames += r.frames;
  }
  std::printf("mean %.3f cm, worst %.2f cm, NEES %.2f, landmarks %.3f cm\n", 100 * sum.mean_m,
              100 * sum.worst_m, sum.nees, 100 * sum.landmark_m);
  return sum;
}

TEST(FleetPaths, WheelsAloneGiveCentimetresObstaclesAndSightingsMillimetres) {
  SimulationOptions wheels;
  wheels.obstacles_seen = wheels.robots_seen = false;
  const RunResult alone = average(wheels), all = average({});
  EXPECT_GT(alone.mean_m, 0.02);  // 2 % of scale error per wheel
  EXPECT_LE(all.mean_m, 0.005);   // 0.19 cm in a prototype
  EXPECT_LE(all.landmark_m, 0.005);
  EXPECT_EQ(all.estimates, all.frames);
  // 3 for a consistent estimate; doubled σ for correlation pulls it down, three seeds scatter it.
  EXPECT_LT(all.nees, 8.0);
}

TEST(FleetPaths, SightingsAloneImproveOnWheels) {
  SimulationOptions wheels, sightings;
  wheels.obstacles_seen = wheels.robots_seen = false;
  sightings.obstacles_seen = false;
  EXPECT_LT(average(sightings).mean_m, 0.5 * average(wheels).mean_m);
}

// Bounds of six runs of three robots each, every run's errors worth about one sample: 3 ± 1.2.
TEST(FleetPaths, CovariancesHoldWhateverIsMissing) {
  constexpr std::uint32_t kRuns = 6;
  SimulationOptions wheels, no_wheels, sightings;
  wheels.obstacles_seen = wheels.robots_seen = false;
  no_wheels.wheels = false;
  sightings.wheels = sightings.obstacles_seen = false;
  for (const SimulationOptions& options : {wheels, no_wheels, sightings}) {
    double nees = 0.0;
    for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kRuns; ++seed)
      nees += run(options, {}, seed).nees / kRuns;
    EXPECT_LT(nees, 4.2);
  }
}

TEST(FleetPaths, AWrongStartAndFlawedCamerasAreSurvived) {
  SimulationOptions flawed;
  flawed.camera_sigma = kFlaw;
  flawed.start_sigma_m = 0.005;
  flawed.start_sigma_rad = 0.00524;
  EXPECT_LE(average(flawed).mean_m, 0.02);  // asked: flawed ≤ 3 cm
}

TEST(FleetPaths, FlawsOfTheCamerasAreEstimatedNotSuffered) {
  SimulationOptions flawed;
  flawed.camera_sigma = kFlaw;
  EstimatorOptions as_calibrated;
  as_calibrated.camera.estimate = false;
  const RunResult suffered = average(flawed, as_calibrated), estimated = average(flawed);
  EXPECT_LT(estimated.mean_m, 0.7 * suffered.mean_m);
  // Nearer the truth than the calibration: focal length and tilt. (The height is told by the wheels' scale
  // and by the fleet's bodies only.)
  EXPECT_LT(estimated.camera(0), 0.7 * suffered.camera(0));
  EXPECT_LT(estimated.camera(2), 0.7 * suffered.camera(2));
  EXPECT_LT(estimated.camera(3), 0.7 * suffered.camera(3));
}

/// Errors of the cameras' focal length and tilt against the truth, rms over robots and seeds.
struct CameraErrors {
  double off = 0.0;  ///< of the published values
  double raw = 0.0;  ///< of the estimates
};
CameraErrors cameraErrors(const SimulationOptions& simulation) {
  CameraErrors sum;
  for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    FleetSimulator simulator(simulation, seed);
    FleetEstimator estimator(simulator.setups(), {});
    for (int i = 0; i < simulation.frames; ++i) {
      const auto frames = simulator.frames(i);
      estimator.process(simulator.time(i), pointers(frames), {});
    }
    std::map<std::string, Eigen::Vector4d> published;
    for (const PoseEstimate& pose : estimator.finish()) published[pose.robot] = pose.camera_error;
    for (int robot = 0; robot < simulation.robots; ++robot) {
      const std::string name = FleetSimulator::name(robot);
      const auto squares = [&](const Eigen::Vector4d& error) {
        const Eigen::Vector4d off = error - simulator.cameraError(robot);
        return (off.squaredNorm() - off(1) * off(1)) / (kSeeds * simulation.robots);
      };
      sum.off += squares(published.at(name));
      sum.raw += squares(estimator.cameraError(name).head<4>());
    }
  }
  std::printf("published %.2f, estimated %.2f thousandths off\n", 1e3 * std::sqrt(sum.off),
              1e3 * std::sqrt(sum.raw));
  return {std::sqrt(sum.off), std::sqrt(sum.raw)};
}

TEST(FleetPaths, PublishesErrorsOfCamerasAndLittleOfGoodOnes) {
  SimulationOptions flawed;
  flawed.camera_sigma = Eigen::Vector4d(0.006, 0.0, 0.007, 0.007);
  const CameraErrors of_flawed = cameraErrors(flawed), of_good = cameraErrors({});
  EXPECT_LT(of_flawed.off, 0.1 * flawed.camera_sigma.norm());
  EXPECT_LT(of_flawed.off, 1.01 * of_flawed.raw);
  EXPECT_LT(of_good.off, 0.8 * of_good.raw);
}

TEST(FleetPaths, OutlinesSeenTooLargeAreNotTakenForAWrongCamera) {
  SimulationOptions swollen;
  swollen.too_large_rad = 0.002;  // 0.3 pixels at 640 × 480
  EstimatorOptions blind;
  blind.camera.contour_sigma_rad = 1e-7;
  for (const bool orthographic : {false, true}) {
    swollen.orthographic = orthographic;
    const RunResult suffered = average(swollen, blind), estimated = average(swollen);
    EXPECT_LT(estimated.mean_m, 0.8 * suffered.mean_m) << orthographic;
    EXPECT_LT(estimated.camera(0), 0.5 * suffered.camera(0))
        << "focal length, which is exact" << orthographic;
  }
}

TEST(FleetEstimator, TwoRunsAreEqualToTheBit) {
  std::vector<Pose2> first;
  for (int round = 0; round < 2; ++round) {
    FleetSimulator simulator({}, 7);
    FleetEstimator estimator(simulator.setups(), {});
    std::size_t at = 0;
    for (int f = 0; f < 40; ++f) {
      const auto frames = simulator.frames(f);
      for (const auto& e : estimator.process(simulator.time(f), pointers(frames), {})) {
        if (round == 0) {
          first.push_back(e.map_from_base);
          continue;
        }
        EXPECT_EQ(first[at].x_m, e.map_from_base.x_m);
        EXPECT_EQ(first[at].y_m, e.map_from_base.y_m);
        EXPECT_EQ(first[at].theta_rad, e.map_from_base.theta_rad);
        ++at;
      }
    }
  }
}

TEST(FleetEstimator, PosesAtOnceAreThoseOfTheWholeWindow) {
  FleetSimulator simulator({}, 8);
  FleetEstimator estimator(simulator.setups(), {});
  EXPECT_FALSE(estimator.refineDue());
  double worst = 0.0;
  for (int f = 0; f < 40; ++f) {
    const auto frames = simulator.frames(f);
    const auto at_once = estimator.process(simulator.time(f), pointers(frames), {});
    EXPECT_TRUE(estimator.refineDue());
    estimator.refine();
    EXPECT_FALSE(estimator.refineDue());
    for (const PoseEstimate& whole : estimator.smoothed()) {
      if (whole.acquired_ns != simulator.time(f) || f < 10) continue;  // few landmarks are well known before
      const auto same = std::find_if(at_once.begin(), at_once.end(),
                                     [&](const PoseEstimate& e) { return e.robot == whole.robot; });
      const Pose2 apart = same->map_from_base.inverse() * whole.map_from_base;
      worst = std::max(worst, apart.vector().dot(same->covariance.ldlt().solve(apart.vector())));
    }
  }
  // Weights of the older views move with the whole solve, within what the estimate itself leaves open.
  EXPECT_LT(worst, 1.0);
  EXPECT_GT(worst, 0.0);
}

TEST(FleetEstimator, RefiningLateChangesNothing) {
  std::vector<Pose2> poses[2];
  for (int late = 0; late < 2; ++late) {
    FleetSimulator simulator({}, 9);
    FleetEstimator estimator(simulator.setups(), {});
    for (int f = 0; f < 30; ++f) {
      const auto frames = simulator.frames(f);
      for (const auto& e : estimator.process(simulator.time(f), pointers(frames), {}))
        poses[late].push_back(e.map_from_base);
      if (late == 0) estimator.refine();
    }
  }
  for (std::size_t i = 0; i < poses[0].size(); ++i)
    EXPECT_EQ(poses[0][i].vector(), poses[1][i].vector()) << i;
}

TEST(FleetEstimator, SightingsNameTheRobots) {
  FleetSimulator simulator({}, 11);
  FleetEstimator estimator(simulator.setups(), {});
  int named = 0;
  for (int f = 0; f < 30; ++f) {
    const auto frames = simulator.frames(f);
    for (const auto& e : estimator.process(simulator.time(f), pointers(frames), {})) {
      for (const Sighting& s : e.sightings) {
        EXPECT_EQ(s.robot, FleetSimulator::name(static_cast<int>(s.track_id) - 100)) << "frame " << f;
        ++named;
      }
    }
  }
  EXPECT_GT(named, 20);
}

TEST(FleetEstimator, ARobotWithoutStartIsLocatedBySighting) {
  SimulationOptions options;
  options.sight_m = 4.0;
  FleetSimulator simulator(options, 3);
  auto setups = simulator.setups();
  setups[2].initial_pose.reset();
  FleetEstimator estimator(setups, {});
  double error = 1e9;
  bool valid = false;
  for (int f = 0; f < 20; ++f) {
    const auto frames = simulator.frames(f);
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    ASSERT_EQ(estimates.size(), 3U);
    valid = estimates[2].valid;
    if (valid)
      error = (estimates[2].map_from_base.translation() - simulator.truth(2, f).translation()).norm();
  }
  EXPECT_TRUE(valid);
  EXPECT_LT(error, 0.02);
}

/// It goes on as it went; by one thing in sight it is not lost within seconds.
TEST(FleetEstimator, ARobotWithoutWheelsIsNotLostAtOnceBesideOneThing) {
  int told = 0, all = 0;
  double worst = 0.0;  // χ² (3 dof)
  for (std::uint32_t seed = 1000; seed < 1012; ++seed) {
    SimulationOptions options;
    options.robots = options.obstacles = 1;
    options.wheels = false;
    options.speed_mps = 0.1;
    FleetSimulator simulator(options, seed);
    FleetEstimator estimator(simulator.setups(), {});
    for (int f = 0; f < 15; ++f) {
      const auto frames = simulator.frames(f);
      const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
      if (estimator.refineDue()) estimator.refine();
      if (frames[0].tracks.empty()) continue;
      ++all;
      told += estimates[0].valid ? 1 : 0;
      if (!estimates[0].valid) continue;
      const Eigen::Vector3d off = (estimates[0].map_from_base.inverse() * simulator.truth(0, f)).vector();
      worst = std::max(worst, off.dot(estimates[0].covariance.ldlt().solve(off)));
    }
  }
  EXPECT_GT(told, 0.9 * all);
  EXPECT_LT(worst, 16.3) << "99.9 %";
}

/// A laser sees the side of things that faces it: their middles are by centimetres less sure than those of
/// whole outlines, and no robot has slipped or was carried for that.
TEST(FleetEstimator, LasersAccuseNobodyOfHavingBeenCarried) {
  int slips = 0, losses = 0;
  for (std::uint32_t seed = 1000; seed < 1006; ++seed) {
    FleetSimulator simulator({}, seed);
    FleetEstimator estimator(simulator.setups(), {});
    for (int f = 0; f < 60; ++f) {
      auto frames = simulator.frames(f);
      for (Objects& frame : frames) {
        frame.camera_height_m = 0.0;
        for (Track& track : frame.tracks) {
          track.height_m = track.height_sigma_m = 0.0;
          for (std::size_t k = 0; k < track.supports.size(); ++k)
            if (track.supports.b_m[k] > 0.0F) track.supports.sigma_m[k] = 0.0F;
        }
      }
      estimator.process(simulator.time(f), pointers(frames), {});
      if (estimator.refineDue()) estimator.refine();
    }
    for (const RobotSetup& setup : simulator.setups()) {
      slips += estimator.status(setup.name).slips;
      losses += estimator.status(setup.name).losses;
    }
  }
  EXPECT_EQ(losses, 0);
  EXPECT_EQ(slips, 0);
}

/// Where each sees something as large as the other, and as far away, that may be so by chance.
TEST(FleetEstimator, ThingsAsLargeAsRobotsAreNoSightings) {
  int placed = 0;
  for (std::uint32_t seed = 1006; seed < 1012; ++seed) {
    SimulationOptions options;
    options.robots = 2;
    options.alike = true;
    options.robots_seen = false;
    FleetSimulator simulator(options, seed);
    auto setups = simulator.setups();
    setups[1].initial_pose.reset();
    for (RobotSetup& setup : setups) {
      setup.body.radius_m = simulator.obstacles().front().radius_m;
      setup.body.height_m = simulator.obstacles().front().height_m;
    }
    FleetEstimator estimator(setups, {});
    for (int f = 0; f < 60; ++f) {
      const auto frames = simulator.frames(f);
      const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
      placed += f == 59 && estimates[1].valid ? 1 : 0;
    }
  }
  EXPECT_EQ(placed, 0);
}

Measurement absolute(const std::string& robot, TimeNs time, const Pose2& pose) {
  Measurement m;
  m.source = "ceiling/c1";
  m.to = robot;
  m.acquired_ns = time;
  m.value = pose.vector();
  m.covariance = Eigen::Vector3d(4e-6, 4e-6, 1e-5).asDiagonal();
  return m;
}

TEST(FleetEstimator, AMeasurementLocatesAndHoldsABlindRobot) {
  SimulationOptions blind;
  blind.robots = 1;
  blind.obstacles_seen = blind.robots_seen = false;
  FleetSimulator simulator(blind, 5);
  auto setups = simulator.setups();
  setups[0].initial_pose.reset();
  FleetEstimator estimator(setups, {});
  for (int f = 0; f < 40; ++f) {
    const auto frames = simulator.frames(f);
    std::vector<Measurement> given;
    if (f >= 5 && f % 5 == 0) given.push_back(absolute("r1", simulator.time(f), simulator.truth(0, f)));
    std::vector<const Measurement*> measurements;
    for (const auto& m : given) measurements.push_back(&m);
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), measurements);
    ASSERT_EQ(estimates[0].valid, f >= 5);
    if (f < 5) continue;
    // 5 steps of 5 cm with 2 % of bias and of noise between measurements of 2 mm.
    EXPECT_LT((estimates[0].map_from_base.translation() - simulator.truth(0, f).translation()).norm(), 0.02);
  }
}

// Live, the first frame may come after the measurement of the frame before.
TEST(FleetEstimator, AnOlderMeasurementLocatesARobotWithoutWheelsNoBetterThanItsMotionIsKnown) {
  SimulationOptions blind;
  blind.robots = 1;
  blind.obstacles_seen = blind.robots_seen = blind.wheels = false;
  FleetSimulator simulator(blind, 5);
  auto setups = simulator.setups();
  setups[0].initial_pose.reset();
  const EstimatorOptions options;
  FleetEstimator estimator(setups, options);
  const Measurement m = absolute("r1", simulator.time(4), simulator.truth(0, 4));
  PoseEstimate located;
  for (int f = 0; f < 6; ++f) {
    const auto frames = simulator.frames(f);
    std::vector<const Measurement*> measurements;
    if (f == 5) measurements.push_back(&m);
    located = estimator.process(simulator.time(f), pointers(frames), measurements)[0];
  }
  ASSERT_TRUE(located.valid);
  const double way_m =
      options.no_wheels_sigma_mps * 1e-9 * static_cast<double>(simulator.time(5) - simulator.time(4));
  EXPECT_GT(std::sqrt(located.covariance(0, 0)), 0.9 * way_m);
  const Eigen::Vector3d off = (located.map_from_base.inverse() * simulator.truth(0, 5)).vector();
  EXPECT_LT(off.dot(located.covariance.ldlt().solve(off)), 16.3) << "99.9 %";
}

TEST(FleetEstimator, AMeasurementBetweenFramesIsMovedByTheMotion) {
  SimulationOptions blind;
  blind.robots = 1;
  blind.obstacles_seen = blind.robots_seen = false;
  blind.wheel_bias_sigma = blind.wheel_noise = 0.0;
  FleetSimulator simulator(blind, 6);
  auto setups = simulator.setups();
  setups[0].initial_pose = simulator.truth(0, 0) * Pose2{0.02, 0.01, 0.01};
  EstimatorOptions options;
  options.initial_sigma_m = 0.05;
  options.initial_sigma_rad = 0.05;
  FleetEstimator estimator(setups, options);
  // Half way between frames 3 and 4, on the same arc.
  const Pose2 step = simulator.truth(0, 3).inverse() * simulator.truth(0, 4);
  const double half = 0.5 * step.theta_rad, chord = step.translation().norm();
  const double arc_m = std::abs(half) < 1e-9 ? chord : chord * half / std::sin(half);
  const double quarter = 0.25 * step.theta_rad;
  const double half_chord =
      std::abs(quarter) < 1e-9 ? 0.5 * arc_m : 0.5 * arc_m * std::sin(quarter) / quarter;
  const Pose2 middle =
      simulator.truth(0, 3) * Pose2{half_chord * std::cos(quarter), half_chord * std::sin(quarter), half};
  const Measurement m = absolute("r1", (simulator.time(3) + simulator.time(4)) / 2, middle);
  PoseEstimate last;
  for (int f = 0; f < 5; ++f) {
    const auto frames = simulator.frames(f);
    std::vector<const Measurement*> measurements;
    if (f == 4) measurements.push_back(&m);
    last = estimator.process(simulator.time(f), pointers(frames), measurements)[0];
  }
  const Pose2 e = simulator.truth(0, 4).inverse() * last.map_from_base;
  EXPECT_LT(e.translation().norm(), 0.002);  // the prior of 5 cm against 2 mm keeps 0.2 % of 2 cm
  EXPECT_LT(std::abs(e.theta_rad), 0.002);
}

TEST(FleetEstimator, FramesOutOfOrderAreInvalidAndHarmless) {
  FleetSimulator simulator({}, 13);
  FleetEstimator estimator(simulator.setups(), {});
  std::vector<Objects> old;
  for (int f = 0; f < 10; ++f) {
    const auto frames = simulator.frames(f);
    if (f == 4) old = frames;
    estimator.process(simulator.time(f), pointers(frames), {});
  }
  const auto late = estimator.process(simulator.time(9), pointers(old), {});
  ASSERT_EQ(late.size(), 3U);
  for (const auto& e : late) EXPECT_FALSE(e.valid);
  Objects stranger;
  stranger.robot = "nobody";
  EXPECT_THROW(estimator.process(simulator.time(10), {&stranger}, {}), std::runtime_error);
}

TEST(FleetEstimator, WheelBiasIsLearned) {
  FleetSimulator simulator({}, 14);
  FleetEstimator estimator(simulator.setups(), {});
  for (int f = 0; f < 60; ++f) {
    const auto frames = simulator.frames(f);
    estimator.process(simulator.time(f), pointers(frames), {});
  }
  for (int r = 0; r < 3; ++r) {
    // 60 steps with 2 % of noise each leave 0.3 %; three of these.
    EXPECT_LT((estimator.wheelBias(FleetSimulator::name(r)) - simulator.bias(r)).lpNorm<Eigen::Infinity>(),
              0.009);
  }
}

TEST(EstimatorOptions, ReadsAndRefuses) {
  const auto good = options::Section::parse("window_frames: 12\nuse_sightings: false\n", "t.yaml");
  EXPECT_EQ(EstimatorOptions::read(good).window_frames, 12);
  EXPECT_FALSE(EstimatorOptions::read(good).use_sightings);
  EXPECT_THROW(EstimatorOptions::read(options::Section::parse("window_frames: 1\n", "t.yaml")),
               options::Error);
  EXPECT_THROW(EstimatorOptions::read(options::Section::parse("windows: 3\n", "t.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::estimation
