// Outlines of which a part is segmented: top faces alone, ragged outlines, outlines that are cut off.

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

constexpr std::uint32_t kFirstOutlineSeed = 1000, kOutlineSeeds = 4;

/// Sides have the colour of the floor: only the top face is segmented, H/(H − h) times as far all round.
void keepTopFace(Track& track, double stretch) {
  for (float& b : track.supports.b_m) {
    if (b < 0.0f) b *= static_cast<float>(stretch);
  }
  track.position_m *= stretch;
  track.contact_m *= stretch;
}

/// The far side is not observed. @param near_sides false: a part of the near sides is missing, too
void cutFarSide(Track& track, bool near_sides) {
  constexpr double kObserved_rad = 1.8;
  const double back = std::atan2(-track.position_m.y(), -track.position_m.x());
  const std::size_t n = track.supports.sigma_m.size();
  for (std::size_t k = 0; k < n; ++k) {
    const double off = wrapAngle(2.0 * M_PI * static_cast<double>(k) / static_cast<double>(n) - back);
    const bool is_observed = std::abs(off) < kObserved_rad && (near_sides || off > -0.5);
    if (!is_observed) track.supports.sigma_m[k] = -1.0f;
  }
  track.truncated = true;
}

/// r1 and r2 segment only the top faces of most obstacles, with varying errors. r3 has correct outlines and a
/// correct initial pose.
TEST(IncompleteOutlines, OfTopFacesDoNotRejectACorrectInitialPose) {
  SimulationOptions options;
  options.obstacles = 10;
  options.frames = 80;
  options.robots_seen = false;  // nor can they be recognised
  for (std::uint32_t seed = kFirstOutlineSeed; seed < kFirstOutlineSeed + kOutlineSeeds; ++seed) {
    FleetSimulator simulator(options, seed);
    auto setups = simulator.setups();
    for (auto& setup : setups) setup.body.radius_m = 0.0;
    FleetEstimator estimator(setups, {});
    int valid = 0;
    for (int f = 0; f < options.frames; ++f) {
      auto frames = simulator.frames(f);
      for (Objects& frame : frames) {
        const bool top_only = frame.robot != "r3";
        for (Track& track : frame.tracks) {
          if (!top_only || track.id % 4 == 0) continue;
          keepTopFace(track, 1.5 + simulator.gauss(0.15));
          track.visible = simulator.gauss(1.0) > 1.0;  // now and then
        }
      }
      for (const PoseEstimate& e : estimator.process(simulator.time(f), pointers(frames), {}))
        valid += e.robot == "r3" && e.valid ? 1 : 0;
      if (estimator.refineDue()) estimator.refine();
    }
    EXPECT_EQ(valid, options.frames) << "seed " << seed;
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

TEST(IncompleteOutlines, WithRaggedContoursLimitOdometryDrift) {
  SimulationOptions options;
  options.wheel_bias_sigma = 0.06;
  options.robots_seen = false;
  double ragged_m = 0.0, unused_m = 0.0;
  for (std::uint32_t seed = kFirstOutlineSeed; seed < kFirstOutlineSeed + kOutlineSeeds; ++seed) {
    ragged_m += meanError(options, seed, 0.85) / kOutlineSeeds;
    unused_m += meanError(options, seed, 0.6) / kOutlineSeeds;  // merged obstacles: not used
  }
  EXPECT_LT(ragged_m, 0.5 * unused_m);
}

/// A lens of 150°: the edge of the image cuts off the far sides.
TEST(IncompleteOutlines, OfNearSidesLimitOdometryDrift) {
  SimulationOptions options;
  options.wheel_bias_sigma = 0.03;
  options.robots_seen = false;
  double whole_near_m = 0.0, partial_near_m = 0.0;
  for (const bool near_sides : {true, false}) {
    for (std::uint32_t seed = kFirstOutlineSeed; seed < kFirstOutlineSeed + kOutlineSeeds; ++seed) {
      FleetSimulator simulator(options, seed);
      FleetEstimator estimator(simulator.setups(), {});
      for (int f = 0; f < options.frames; ++f) {
        auto frames = simulator.frames(f);
        for (Objects& frame : frames) {
          for (Track& track : frame.tracks) cutFarSide(track, near_sides);
        }
        const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
        if (estimator.refineDue()) estimator.refine();
        for (std::size_t r = 0; r < estimates.size(); ++r)
          (near_sides ? whole_near_m : partial_near_m) +=
              (estimates[r].map_from_base.translation() -
               simulator.truth(static_cast<int>(r), f).translation())
                  .norm();
      }
    }
  }
  EXPECT_LT(whole_near_m, 0.1 * partial_near_m);
}

/// The only obstacle in view looks like a robot and is within the gate of a robot with uncertain odometry.
TEST(Sightings, StaticObstacleThatLooksLikeARobotMovesNoPose) {
  SimulationOptions options;
  options.robots = 2;
  options.obstacles = 8;
  options.equal_discs = true;
  options.wheel_bias_sigma = 0.05;
  options.frames = 80;
  int observed = 0;
  for (std::uint32_t seed = kFirstOutlineSeed; seed < kFirstOutlineSeed + 2 * kOutlineSeeds; ++seed) {
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
          for (Track& track : tracks) track.kind = ObjectKind::kRobot, ++observed;
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
  EXPECT_GT(observed, 100);
}

}  // namespace
}  // namespace omnifleet::estimation
