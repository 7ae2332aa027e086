// Things of which half is seen: what does not stand where it seems to, and what tells a little all the same.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "estimation/estimator.h"
#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

using testing::FleetSimulator;
using testing::pointers;
using testing::SimulationOptions;

constexpr std::uint32_t kFirstOfHalves = 1000, kHalves = 4;

/// Sides that look like the floor: the top alone, H/(H − h) times as far all round.
void seeTopAlone(Track& track, double stretch) {
  for (float& b : track.supports.b_m) {
    if (b < 0.0f) b *= static_cast<float>(stretch);
  }
  track.position_m *= stretch;
  track.contact_m *= stretch;
}

/// What lies beyond is not seen; `sides`: else nor is a part of the side towards the camera.
void cutFarSide(Track& track, bool sides) {
  constexpr double kSeen_rad = 1.8;
  const double back = std::atan2(-track.position_m.y(), -track.position_m.x());
  const std::size_t n = track.supports.sigma_m.size();
  for (std::size_t k = 0; k < n; ++k) {
    const double off = wrapAngle(2.0 * M_PI * static_cast<double>(k) / static_cast<double>(n) - back);
    const bool is_seen = std::abs(off) < kSeen_rad && (sides || off > -0.5);
    if (!is_seen) track.supports.sigma_m[k] = -1.0f;
  }
  track.truncated = true;
}

/// Of obstacles every second one, by all robots but r3, and never twice alike.
TEST(HalfSeen, TopsThatFloatAccuseNoExactStart) {
  SimulationOptions options;
  options.obstacles = 10;
  options.frames = 80;
  options.robots_seen = false;  // nor known what they look like
  for (std::uint32_t seed = kFirstOfHalves; seed < kFirstOfHalves + kHalves; ++seed) {
    FleetSimulator simulator(options, seed);
    auto setups = simulator.setups();
    for (auto& setup : setups) setup.body.radius_m = 0.0;
    FleetEstimator estimator(setups, {});
    int told = 0;
    for (int f = 0; f < options.frames; ++f) {
      auto frames = simulator.frames(f);
      for (Objects& frame : frames) {
        const bool half = frame.robot != "r3";
        for (Track& track : frame.tracks) {
          if (!half || track.id % 4 == 0) continue;
          seeTopAlone(track, 1.5 + simulator.gauss(0.15));
          track.visible = simulator.gauss(1.0) > 1.0;  // now and then
        }
      }
      for (const PoseEstimate& e : estimator.process(simulator.time(f), pointers(frames), {}))
        told += e.robot == "r3" && e.valid ? 1 : 0;
      if (estimator.refineDue()) estimator.refine();
    }
    EXPECT_EQ(told, options.frames) << "seed " << seed;
    EXPECT_EQ(estimator.status("r3").wrong_starts, 0) << "seed " << seed;
  }
}

double meanError(const SimulationOptions& options, std::uint32_t seed, double solidity) {
  FleetSimulator simulator(options, seed);
  FleetEstimator estimator(simulator.setups(), {});
  double sum_m = 0.0;
  for (int f = 0; f < options.frames; ++f) {
    auto frames = simulator.frames(f);
    for (Objects& frame : frames) {
      for (Track& track : frame.tracks) track.solidity = solidity;
    }
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    if (estimator.refineDue()) estimator.refine();
    for (std::size_t r = 0; r < estimates.size(); ++r)
      sum_m +=
          (estimates[r].map_from_base.translation() - simulator.truth(static_cast<int>(r), f).translation())
              .norm();
  }
  return sum_m / (options.frames * options.robots);
}

TEST(HalfSeen, RaggedOutlinesHoldAHeadingThatNothingElseHolds) {
  SimulationOptions options;
  options.wheel_bias_sigma = 0.06;
  options.robots_seen = false;
  double ragged_m = 0.0, torn_m = 0.0;
  for (std::uint32_t seed = kFirstOfHalves; seed < kFirstOfHalves + kHalves; ++seed) {
    ragged_m += meanError(options, seed, 0.85) / kHalves;
    torn_m +=
        meanError(options, seed, 0.6) / kHalves;  // several things that run together: by the wheels alone
  }
  EXPECT_LT(ragged_m, 0.5 * torn_m);
}

/// A lens of 150°: the edge of the view cuts off all that is farther than its top is seen.
TEST(HalfSeen, SidesTowardsTheCameraHoldAPoseWhereTheRestIsCutOff) {
  SimulationOptions options;
  options.wheel_bias_sigma = 0.03;
  options.robots_seen = false;
  double cut_m = 0.0, alone_m = 0.0;
  for (const bool sides : {true, false}) {
    for (std::uint32_t seed = kFirstOfHalves; seed < kFirstOfHalves + kHalves; ++seed) {
      FleetSimulator simulator(options, seed);
      FleetEstimator estimator(simulator.setups(), {});
      for (int f = 0; f < options.frames; ++f) {
        auto frames = simulator.frames(f);
        for (Objects& frame : frames) {
          for (Track& track : frame.tracks) cutFarSide(track, sides);
        }
        const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
        if (estimator.refineDue()) estimator.refine();
        for (std::size_t r = 0; r < estimates.size(); ++r)
          (sides ? cut_m : alone_m) += (estimates[r].map_from_base.translation() -
                                        simulator.truth(static_cast<int>(r), f).translation())
                                           .norm();
      }
    }
  }
  EXPECT_LT(cut_m, 0.1 * alone_m);
}

/// Nothing is seen but a thing that looks like a robot and stands within the gate of uncertain wheels.
TEST(HalfSeen, WhatLooksLikeARobotButStandsMovesNone) {
  SimulationOptions options;
  options.robots = 2;
  options.obstacles = 8;
  options.alike = true;
  options.wheel_bias_sigma = 0.05;
  options.frames = 80;
  int seen = 0;
  for (std::uint32_t seed = kFirstOfHalves; seed < kFirstOfHalves + 2 * kHalves; ++seed) {
    double worst_m[2] = {0.0, 0.0};
    for (const bool alone : {true, false}) {
      FleetSimulator simulator(options, seed);
      auto setups = simulator.setups();
      for (auto& setup : setups) setup.body.radius_m = 0.12, setup.body.height_m = 0.2;
      FleetEstimator estimator(setups, {});
      for (int f = 0; f < options.frames; ++f) {
        auto frames = simulator.frames(f);
        for (std::size_t r = 0; r < frames.size(); ++r) {
          const int other = 1 - static_cast<int>(r);
          const Eigen::Vector2d there =
              (simulator.truth(static_cast<int>(r), f).inverse() * simulator.truth(other, f)).translation();
          const auto away = [&](const Track& track) {
            const double off_m = (track.position_m - there).norm();
            return alone || track.id >= 100 || off_m < 0.4 || off_m > 0.6;
          };
          auto& tracks = frames[r].tracks;
          tracks.erase(std::remove_if(tracks.begin(), tracks.end(), away), tracks.end());
          for (Track& track : tracks) track.kind = ObjectKind::kRobot, ++seen;
        }
        const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
        for (std::size_t r = 0; r < estimates.size(); ++r)
          worst_m[alone ? 0 : 1] =
              std::max(worst_m[alone ? 0 : 1], (estimates[r].map_from_base.translation() -
                                                simulator.truth(static_cast<int>(r), f).translation())
                                                   .norm());
      }
    }
    EXPECT_LT(worst_m[1], worst_m[0] + 0.05) << "seed " << seed;
  }
  EXPECT_GT(seen, 100);
}

}  // namespace
}  // namespace omnifleet::estimation
