// Whom the estimator believes: wheels that slip, a robot that is carried away, views that are none.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/estimator.h"
#include "estimation/messages.h"
#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

using testing::FleetSimulator;
using testing::pointers;
using testing::SimulationOptions;

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

/// What stands around has refuted the wheels, which slip for half a second, and tells the motion or not.
TEST(FleetEstimator, WheelsThatWhatIsSeenRefutesAreTold) {
  for (const bool known : {true, false}) {
    FleetSimulator simulator({}, 12);
    FleetEstimator estimator(simulator.setups(), {});
    double worst_m = 0.0;
    for (int f = 0; f < 40; ++f) {
      auto frames = simulator.frames(f);
      if (f >= 20 && f < 25) {
        Motion& motion = frames[0].motion;
        motion.previous_from_current = simulator.truth(0, f - 1).inverse() * simulator.truth(0, f);
        motion.covariance = 1e-4 * Eigen::Matrix3d::Identity();
        motion.valid = known;
        motion.left_m += 0.3, motion.right_m += 0.3;
        motion.wheels_rejected = true;
      }
      const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
      worst_m = std::max(
          worst_m, (estimates[0].map_from_base.translation() - simulator.truth(0, f).translation()).norm());
      EXPECT_EQ(estimator.status("r1").state == RobotState::kSlipping, f >= 20 && f < 25) << f;
    }
    EXPECT_EQ(estimator.status("r1").slips, 5);
    EXPECT_LT(worst_m, 0.02) << known;
  }
}

// Their own noise is no news.
TEST(FleetEstimator, WheelsThatAreRefutedByLittleAreNotTold) {
  FleetSimulator simulator({}, 12);
  FleetEstimator estimator(simulator.setups(), {});
  for (int f = 0; f < 30; ++f) {
    auto frames = simulator.frames(f);
    frames[0].motion.wheels_rejected = f == 20;
    estimator.process(simulator.time(f), pointers(frames), {});
  }
  EXPECT_EQ(estimator.status("r1").slips, 0);
  EXPECT_EQ(estimator.status("r1").losses, 0);
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

/// It keeps what it follows, and its tracker tells how far it was carried: it is never lost.
TEST(FleetEstimator, ARobotThatSeesHowItIsCarriedIsPlacedAtOnce) {
  SimulationOptions options;
  options.obstacles = 8;
  options.robots_seen = false;
  options.speed_mps = 0.1;
  FleetSimulator simulator(options, 21);
  FleetEstimator estimator(simulator.setups(), {});
  constexpr int kCarried = 25;
  for (int f = 0; f < 40; ++f) {
    auto frames = simulator.frames(f);
    if (f >= kCarried) {
      frames[0] = frames[1];
      frames[0].robot = "r1";
      for (Track& track : frames[0].tracks) track.id += 500;
    }
    if (f == kCarried) {
      Motion& motion = frames[0].motion;
      motion.previous_from_current = simulator.truth(0, f - 1).inverse() * simulator.truth(1, f);
      motion.covariance = 1e-4 * Eigen::Matrix3d::Identity();
      motion.left_m = motion.right_m = 0.0;
      motion.wheels_rejected = true;
    }
    const auto estimates = estimator.process(simulator.time(f), {&frames[0], &frames[1], &frames[2]}, {});
    EXPECT_TRUE(estimates[0].valid) << f;
    if (f == kCarried) {
      EXPECT_EQ(estimator.status("r1").message, relocalized(false));
    }
    const Pose2& truth = simulator.truth(f < kCarried ? 0 : 1, f);
    EXPECT_LT((estimates[0].map_from_base.translation() - truth.translation()).norm(), 0.03) << f;
  }
  EXPECT_EQ(estimator.status("r1").losses, 1);
}

/// To another robot's place and back, every four frames.
TEST(FleetEstimator, WhoSeemsToBeCarriedAgainAndAgainMayHaveAnotherLens) {
  SimulationOptions options;
  options.robots_seen = false;
  options.speed_mps = 0.1;
  FleetSimulator simulator(options, 21);
  FleetEstimator estimator(simulator.setups(), {});
  std::vector<Message> told;
  int before = 0;
  for (int f = 0; f < 45; ++f) {
    auto frames = simulator.frames(f);
    const int where = f < 25 ? 0 : 1 - (f - 25) / 4 % 2;
    Motion motion = frames[0].motion;
    frames[0].tracks = frames[static_cast<std::size_t>(where)].tracks;
    for (Track& track : frames[0].tracks) track.id += 500U * static_cast<std::uint32_t>(where);
    if (where != before || where != 0) {
      motion.previous_from_current = simulator.truth(before, f - 1).inverse() * simulator.truth(where, f);
      motion.covariance = 1e-4 * Eigen::Matrix3d::Identity();
    }
    if (where != before) motion.left_m = motion.right_m = 0.0, motion.wheels_rejected = true;
    frames[0].motion = motion;
    estimator.process(simulator.time(f), pointers(frames), {});
    if (where != before) told.push_back(estimator.status("r1").message);
    before = where;
  }
  ASSERT_EQ(told.size(), 5U);
  EXPECT_EQ(told[2], relocalized(false));
  EXPECT_EQ(told[3], relocalized(true));
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

/// A robot of named landmarks alone, as recordings of ranges and bearings are: without its wheels for a while
/// its heading may be anything, until the landmarks tell it.
TEST(FleetEstimator, WhoseHeadingWasLostIsBackWhenRangesAndBearingsTellIt) {
  SimulationOptions options;
  options.robots = 1;
  options.obstacles_seen = options.robots_seen = false;
  FleetSimulator simulator(options, 12);
  FleetEstimator estimator(simulator.setups(), {});
  const std::vector<Eigen::Vector2d> places{{2.0, 1.0}, {-1.0, 1.5}, {0.5, -1.8}, {1.5, -1.0}};
  std::vector<Measurement> survey;
  for (std::size_t k = 0; k < places.size(); ++k) {
    Measurement told;
    told.kind = MeasurementKind::kPosition;
    told.to = std::to_string(k);
    told.acquired_ns = simulator.time(0);
    told.value.head<2>() = places[k];
    told.covariance *= 1e-4;
    survey.push_back(told);
  }
  bool was_lost = false;
  for (int f = 0; f < options.frames; ++f) {
    auto frames = simulator.frames(f);
    const bool blind = f >= 10 && f < 30;
    frames[0].motion.valid = frames[0].motion.valid && !blind;
    std::vector<Measurement> measurements = f == 0 ? survey : std::vector<Measurement>{};
    for (std::size_t k = 0; k < places.size() && !blind; ++k) {
      const Eigen::Vector2d at = simulator.truth(0, f).inverse() * places[k];
      Measurement seen;
      seen.kind = MeasurementKind::kRangeBearing;
      seen.from = "r1";
      seen.to = std::to_string(k);
      seen.acquired_ns = seen.from_ns = simulator.time(f);
      seen.value.head<2>() = Eigen::Vector2d(at.norm(), std::atan2(at.y(), at.x()));
      seen.covariance = Eigen::Vector3d(1e-3, 1e-4, 1.0).asDiagonal();
      measurements.push_back(seen);
    }
    std::vector<const Measurement*> told;
    for (const Measurement& measurement : measurements) told.push_back(&measurement);
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), told);
    was_lost = was_lost || !estimates[0].valid;
    if (f < 45) continue;
    EXPECT_TRUE(estimates[0].valid) << f;
    EXPECT_LT((estimates[0].map_from_base.translation() - simulator.truth(0, f).translation()).norm(), 0.05)
        << f;
  }
  EXPECT_TRUE(was_lost);
}

}  // namespace
}  // namespace omnifleet::estimation
