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
using testing::run;
using testing::RunResult;
using testing::SimulationOptions;

constexpr std::uint32_t kFirstSeed = 1000, kSeeds = 3;  // estimation_seeds runs all of 1000–1099

/// Of calibrations: 0.3 % of the focal length, 2 mm of the height, 0.2° of roll and pitch.
const Eigen::Vector4d kFlaw(0.003, 0.004, 0.0035, 0.0035);

std::vector<const Objects*> pointers(const std::vector<Objects>& frames) {
  std::vector<const Objects*> all;
  for (const Objects& frame : frames) all.push_back(&frame);
  return all;
}

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

/// What the poses say of the cameras, rms over robots and seeds: focal length and tilt against the truth.
struct Told {
  double off = 0.0;  ///< what is told
  double raw = 0.0;  ///< what is estimated
};
Told toldOfCameras(const SimulationOptions& simulation) {
  Told sum;
  for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    FleetSimulator simulator(simulation, seed);
    FleetEstimator estimator(simulator.setups(), {});
    for (int i = 0; i < simulation.frames; ++i) {
      const auto frames = simulator.frames(i);
      estimator.process(simulator.time(i), pointers(frames), {});
    }
    std::map<std::string, Eigen::Vector4d> told;
    for (const PoseEstimate& pose : estimator.finish()) told[pose.robot] = pose.camera_error;
    for (int robot = 0; robot < simulation.robots; ++robot) {
      const std::string name = FleetSimulator::name(robot);
      const auto squares = [&](const Eigen::Vector4d& error) {
        const Eigen::Vector4d off = error - simulator.cameraError(robot);
        return (off.squaredNorm() - off(1) * off(1)) / (kSeeds * simulation.robots);
      };
      sum.off += squares(told.at(name));
      sum.raw += squares(estimator.cameraError(name).head<4>());
    }
  }
  std::printf("told %.2f, estimated %.2f thousandths off\n", 1e3 * std::sqrt(sum.off),
              1e3 * std::sqrt(sum.raw));
  return {std::sqrt(sum.off), std::sqrt(sum.raw)};
}

TEST(FleetPaths, WhatIsToldOfACameraIsItsErrorAndLessOfAGoodOne) {
  SimulationOptions flawed;
  flawed.camera_sigma = Eigen::Vector4d(0.006, 0.0, 0.007, 0.007);
  const Told of_flawed = toldOfCameras(flawed), of_good = toldOfCameras({});
  EXPECT_LT(of_flawed.off, 0.1 * flawed.camera_sigma.norm());
  EXPECT_LT(of_flawed.off, 1.01 * of_flawed.raw);
  EXPECT_LT(of_good.off, 0.8 * of_good.raw);
}

TEST(FleetPaths, OutlinesSeenTooLargeAreNotTakenForAWrongCamera) {
  SimulationOptions swollen;
  swollen.too_large_rad = 0.002;  // 0.3 pixels at 640 × 480
  EstimatorOptions blind;
  blind.camera.contour_sigma_rad = 1e-7;
  const RunResult suffered = average(swollen, blind), estimated = average(swollen);
  EXPECT_LT(estimated.mean_m, 0.8 * suffered.mean_m);
  EXPECT_LT(estimated.camera(0), 0.5 * suffered.camera(0)) << "focal length, which is exact";
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

TEST(FleetEstimator, SlippingWheelsAreNoticedAndSurvived) {
  FleetSimulator simulator({}, 12);
  FleetEstimator estimator(simulator.setups(), {});
  double worst = 0.0;
  for (int f = 0; f < 40; ++f) {
    auto frames = simulator.frames(f);
    if (f == 20)
      frames[0].motion.previous_from_current = frames[0].motion.previous_from_current * Pose2{0.06, 0.0, 0.1};
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    worst = std::max(worst,
                     (estimates[0].map_from_base.translation() - simulator.truth(0, f).translation()).norm());
    EXPECT_EQ(estimator.status("r1").state == RobotState::kSlipping, f == 20) << f;
  }
  EXPECT_EQ(estimator.status("r1").slips, 1);
  EXPECT_LT(worst, 0.02);
}

/// All robots slip by 6 cm in one frame: the largest error from then on, how many were told.
struct Slips {
  double worst_m = 0.0;
  int told = 0, told_wrongly = 0;
};
Slips slipping(std::uint32_t seed) {
  FleetSimulator simulator({}, seed);
  FleetEstimator estimator(simulator.setups(), {});
  Slips slips;
  for (int f = 0; f < 30; ++f) {
    auto frames = simulator.frames(f);
    for (Objects& frame : frames) {
      if (f != 20) continue;
      frame.motion.previous_from_current = frame.motion.previous_from_current * Pose2{0.06, 0.0, 0.1};
    }
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    for (int r = 0; r < 3; ++r) {
      const bool told = estimator.status(FleetSimulator::name(r)).state == RobotState::kSlipping;
      (f == 20 ? slips.told : slips.told_wrongly) += told ? 1 : 0;
      const Pose2& exact = simulator.truth(r, f);
      const Eigen::Vector2d off = estimates[static_cast<std::size_t>(r)].map_from_base.translation();
      if (f >= 20) slips.worst_m = std::max(slips.worst_m, (off - exact.translation()).norm());
    }
  }
  return slips;
}

// A slip as large as what makes a view no view of a thing: the wheels must be doubted before the views are.
TEST(FleetEstimator, WheelsAreDoubtedBeforeWhatIsSeen) {
  double mean_m = 0.0;
  int told = 0, told_wrongly = 0;
  for (std::uint32_t seed = 1000; seed < 1005; ++seed) {
    const Slips slips = slipping(seed);
    mean_m += slips.worst_m / 5.0;
    told += slips.told;
    told_wrongly += slips.told_wrongly;
  }
  std::printf("worst of a run %.2f cm on average, %d of 15 told\n", 100.0 * mean_m, told);
  EXPECT_GE(told, 14);  // one may have nothing in sight
  EXPECT_EQ(told_wrongly, 0);
  EXPECT_LT(mean_m, 0.03);  // half of the slip: what is left where hardly anything is in sight
}

TEST(FleetEstimator, ARobotCarriedAwayIsNoticedAndFindsItselfByItsSurroundings) {
  SimulationOptions options;
  options.obstacles = 8;
  options.robots_seen = false;
  options.speed_mps = 0.1;
  FleetSimulator simulator(options, 21), elsewhere(options, 21);
  FleetEstimator estimator(simulator.setups(), {});
  constexpr int kCarried = 25;
  // From frame 25 on robot 1 sees what robot 2 sees: as if set down half a metre or more away, wheels still.
  ASSERT_GT((simulator.truth(0, kCarried).translation() - simulator.truth(1, kCarried).translation()).norm(),
            0.5);
  int wrong = 0;
  std::size_t landmarks = 0;
  PoseEstimate last;
  for (int f = 0; f < 45; ++f) {
    auto frames = simulator.frames(f);
    if (f >= kCarried) {
      const Motion own = frames[0].motion;
      frames[0] = frames[1];
      frames[0].robot = "r1";
      if (f == kCarried) frames[0].motion = own;
      for (Track& track : frames[0].tracks) track.id += 500;  // its tracker has lost all it followed
    }
    const auto estimates = estimator.process(simulator.time(f), {&frames[0], &frames[1], &frames[2]}, {});
    if (f == kCarried - 1) landmarks = estimator.landmarks().size();
    if (f < kCarried) continue;
    last = estimates[0];
    const double error = (last.map_from_base.translation() - simulator.truth(1, f).translation()).norm();
    wrong += last.valid && error > 0.1 ? 1 : 0;
  }
  EXPECT_EQ(wrong, 0);  // no frame at a wrong place is called valid
  EXPECT_TRUE(last.valid);
  EXPECT_EQ(estimator.status("r1").losses, 1);
  EXPECT_LE(estimator.landmarks().size(), landmarks + 1);  // nothing was mapped twice
}

TEST(FleetEstimator, AFrameOfSplintersAndSwollenOutlinesIsNoRobotCarriedAway) {
  SimulationOptions options;
  options.obstacles = 8;
  options.robots_seen = false;
  options.speed_mps = 0.1;
  FleetSimulator simulator(options, 21);
  FleetEstimator estimator(simulator.setups(), {});
  for (int f = 0; f < 30; ++f) {
    auto frames = simulator.frames(f);
    if (f == 25) {  // badly segmented: all things swollen by 12 cm, two slivers where nothing stands
      for (Track& track : frames[0].tracks) {
        for (float& b : track.supports.b_m) b += 0.12f;
        track.id += 500;
      }
      ASSERT_GE(frames[0].tracks.size(), 2U);
      for (const double bearing : {0.3, 2.0}) {
        Track sliver = frames[0].tracks.front();
        sliver.id = 900 + static_cast<std::uint32_t>(10 * bearing);
        const auto count = static_cast<double>(sliver.supports.b_m.size());
        for (std::size_t k = 0; k < sliver.supports.b_m.size(); ++k)
          sliver.supports.b_m[k] =
              static_cast<float>(0.5 * std::cos(2.0 * M_PI * static_cast<double>(k) / count - bearing));
        sliver.position_m = 0.5 * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
        frames[0].tracks.push_back(sliver);
      }
    }
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    EXPECT_TRUE(estimates[0].valid) << f;
  }
  EXPECT_EQ(estimator.status("r1").losses, 0);
}

/// Outlines that were inferred more than seen (their σ says so) come along with the robot, as tops of things
/// whose sides are of the floor's colour do.
TEST(FleetEstimator, WhatIsSeenRoughlyMovesNoPose) {
  SimulationOptions lone;
  lone.robots = 1;
  const auto endOf = [&](bool sees) {
    FleetSimulator simulator(lone, 21);
    FleetEstimator estimator(simulator.setups(), {});
    PoseEstimate last;
    int seen = 0;
    for (int f = 0; f < lone.frames; ++f) {
      auto frames = simulator.frames(f);
      for (Track& track : frames[0].tracks) {
        seen += track.visible ? 1 : 0;
        for (float& b : track.supports.b_m) b *= 1.4f;
        for (float& sigma : track.supports.sigma_m) sigma *= 15.0f;
      }
      EXPECT_GT(seen, 0);
      if (!sees) frames[0].tracks.clear();
      last = estimator.process(simulator.time(f), pointers(frames), {})[0];
      EXPECT_NE(estimator.status("r1").state, RobotState::kSlipping) << f;
    }
    return last.map_from_base;
  };
  const Pose2 blind = endOf(false), rough = endOf(true);
  EXPECT_LT((blind.translation() - rough.translation()).norm(), 1e-3);
  EXPECT_LT(std::abs(wrapAngle(blind.theta_rad - rough.theta_rad)), 1e-3);
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
