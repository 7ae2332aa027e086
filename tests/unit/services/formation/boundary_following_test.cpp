// Rovers with forward cameras follow the boundary of arenas of blocks (Ahmed et al. 2013 §3).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "motion/motion_guard.h"
#include "rover_simulator.h"

namespace omnifleet::formation {
namespace {

std::string boundary(const std::string& more = "") {
  return R"(
behaviour: boundary_following
boundary_m: 0.25
limits: {cruise_mps: 0.20, max_turn_radps: 1.0}
grid: {centre_m: [1.5, 1.0], size_m: [3.6, 2.6]}
)" + more;
}

struct Round {
  double turned_rad = 0.0;  ///< of the bearing of the robot from the middle of the arena
  double error_m = 0.0;     ///< mean absolute error of the distance while the ground is clear
  double clear = 0.0;       ///< share of frames with the ground clearance signal
  double travelled_m = 0.0;
  double wall_share = 0.0;  ///< share of the outer wall's length that the robot has passed within 0.5 m
  double gap_m = 0.0;
};

Round drive(const BlockArena& arena, std::uint32_t seed, double duration_s, const std::string& options) {
  RoverSimulator simulator(arena, options, seed);
  Round round;
  const Eigen::Vector2d middle_m(0.5 * arena.width_m, 0.5 * arena.depth_m);
  const auto bearing = [&] {
    const Eigen::Vector2d way_m = simulator.poses()[0].translation() - middle_m;
    return std::atan2(way_m.y(), way_m.x());
  };
  std::vector<Eigen::Vector2d> wall_m;
  for (double along_m = 0.05; along_m < 2 * (arena.width_m + arena.depth_m); along_m += 0.1) {
    const double w = arena.width_m, d = arena.depth_m;
    if (along_m < w)
      wall_m.emplace_back(along_m, 0.0);
    else if (along_m < w + d)
      wall_m.emplace_back(w, along_m - w);
    else if (along_m < 2 * w + d)
      wall_m.emplace_back(along_m - w - d, d);
    else
      wall_m.emplace_back(0.0, along_m - 2 * w - d);
  }
  std::vector<bool> passed(wall_m.size(), false);
  double before_rad = bearing(), error_m = 0.0;
  int frames = 0, clear = 0, followed = 0;
  while (simulator.time_s() < duration_s) {
    const Eigen::Vector2d from_m = simulator.poses()[0].translation();
    simulator.step();
    const Eigen::Vector2d here_m = simulator.poses()[0].translation();
    round.travelled_m += (here_m - from_m).norm();
    const double now_rad = bearing();
    round.turned_rad += wrapAngle(now_rad - before_rad);
    before_rad = now_rad;
    const motion::FormationState& state = simulator.state(0);
    ++frames;
    clear += state.ground_clear;
    for (std::size_t i = 0; i < wall_m.size(); ++i)
      passed[i] = passed[i] || (here_m - wall_m[i]).norm() < 0.5;
    if (!state.ground_clear || simulator.time_s() < 0.3 * duration_s) continue;
    ++followed;
    error_m += std::abs(state.distance_error_m);
    EXPECT_FALSE(state.view.ray.empty());
  }
  round.error_m = error_m / std::max(1, followed);
  round.clear = static_cast<double>(clear) / frames;
  round.gap_m = simulator.leastGap();
  round.wall_share = static_cast<double>(std::count(passed.begin(), passed.end(), true)) /
                     static_cast<double>(passed.size());
  return round;
}

TEST(BoundaryFollowing, GoesRoundTheEmptyArenaAtTheCommandedDistance) {
  for (const char* side : {"right", "left"}) {
    BlockArena arena = emptyArena();
    arena.robots.resize(1);
    arena.driving = 1;
    const Round round = drive(arena, 1, 120.0, boundary(std::string("boundary: {side: ") + side + "}\n"));
    std::printf("%s: turned %.1f rad, error %.1f cm, clear %.0f %%, %.1f m, gap %.1f cm, wall %.0f %%\n",
                side, round.turned_rad, 100 * round.error_m, 100 * round.clear, round.travelled_m,
                100 * round.gap_m, 100 * round.wall_share);
    // The wall on the right: against the clock.
    EXPECT_GT((side == std::string("right") ? 1.0 : -1.0) * round.turned_rad, 2.0 * M_PI) << side;
    EXPECT_EQ(round.wall_share, 1.0) << side;
    EXPECT_LT(round.error_m, 0.04) << side;
    EXPECT_GT(round.gap_m, 0.05) << side;
  }
}

TEST(BoundaryFollowing, TwoRobotsFollowTheBoundaryWithoutCollision) {
  unsigned first = 1000, last = 1009;
  if (const char* given = std::getenv("OMNIFLEET_EXPLORATION_SEEDS"))
    std::sscanf(given, "%u:%u", &first, &last);
  int complete = 0;
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    const Round round = drive(randomArena(seed), seed, 150.0, boundary());
    std::printf("seed %u: turned %.1f rad, error %.1f cm, clear %.0f %%, %.1f m, gap %.1f cm, wall %.0f %%\n",
                seed, round.turned_rad, 100 * round.error_m, 100 * round.clear, round.travelled_m,
                100 * round.gap_m, 100 * round.wall_share);
    EXPECT_GT(round.gap_m, 0.03) << seed;
    EXPECT_GT(round.travelled_m, 10.0) << seed;
    EXPECT_LT(round.error_m, 0.06) << seed;
    complete += round.wall_share >= 0.85;
  }
  // A robot that starts beside a free-standing block may follow that.
  EXPECT_GE(complete, static_cast<int>(0.7 * (last - first + 1)));
}

}  // namespace
}  // namespace omnifleet::formation
