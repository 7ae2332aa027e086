// Whole fleets with rendered cameras, every stage, in seeded arenas: each run reaches its goal, nothing is
// touched, the formation is regained after an obstacle. Judged by the truth that the world writes, with
// geometry of its own. OMNIFLEET_ARENAS=FIRST:LAST chooses the seeds; by default three of them, all hundred
// in the slow set.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "dataset/ground_truth.h"
#include "fleet_in_process/in_process.h"
#include "formation/formation.h"
#include "motion/formation_law.h"

namespace omnifleet::services {
namespace {

namespace fs = std::filesystem;

constexpr double kRadiusM = 0.15;   // the demo's robots
constexpr double kInPlaceM = 0.15;  // half a body out of place is out of formation
constexpr double kNearM =
    0.45;  // an obstacle so near to a robot or its place disturbs: body, margin, reserve

struct Outcome {
  double goal_m = INFINITY;    ///< leader to goal at the end
  double gap_m = INFINITY;     ///< least between bodies and obstacles
  double robots_m = INFINITY;  ///< least between bodies
  double regain_s = 0.0;       ///< longest time out of place with no obstacle near
  double seconds = 0.0;        ///< whole run
};

double toPolygon(const Eigen::Vector2d& point, const Polygon& polygon) {
  if (contains(polygon, point)) return 0.0;
  double least_m = INFINITY;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], way = polygon[(i + 1) % polygon.size()] - a;
    const double along = std::clamp((point - a).dot(way) / way.squaredNorm(), 0.0, 1.0);
    least_m = std::min(least_m, (point - a - along * way).norm());
  }
  return least_m;
}

double toScene(const Eigen::Vector2d& point, const std::vector<dataset::MapObject>& scene) {
  double least_m = INFINITY;
  for (const dataset::MapObject& object : scene)
    least_m = std::min(least_m, toPolygon(point, object.outline_m));
  return least_m;
}

/// Judges one run by its truth. `orders`: what the formation was told.
Outcome judge(const dataset::GroundTruth& truth, const motion::FormationCommand& orders) {
  Outcome outcome;
  std::vector<const std::vector<dataset::StampedPose>*> paths;
  for (const auto& [robot, path] : truth.trajectories) paths.push_back(&path);
  const std::size_t frames = paths.front()->size();
  const std::vector<Eigen::Vector2d> places = motion::placesOf(orders, paths.size());
  double out_s = 0.0;
  for (std::size_t f = 0; f < frames; ++f) {
    const Pose2& leader = (*paths[0])[f].map_from_base;
    bool near = false, out = false;
    for (std::size_t i = 0; i < paths.size(); ++i) {
      const Eigen::Vector2d here_m = (*paths[i])[f].map_from_base.translation(), place_m = leader * places[i];
      const double clear_m = toScene(here_m, truth.scene);
      outcome.gap_m = std::min(outcome.gap_m, clear_m - kRadiusM);
      near = near || std::min(clear_m, toScene(place_m, truth.scene)) < kNearM;
      out = out || (here_m - place_m).norm() > kInPlaceM;
      for (std::size_t j = 0; j < i; ++j) {
        const double apart_m = (here_m - (*paths[j])[f].map_from_base.translation()).norm();
        outcome.robots_m = std::min(outcome.robots_m, apart_m - 2.0 * kRadiusM);
      }
    }
    const double dt_s =
        f > 0 ? 1e-9 * static_cast<double>((*paths[0])[f].time_ns - (*paths[0])[f - 1].time_ns) : 0.0;
    out_s = out && !near ? out_s + dt_s : 0.0;
    outcome.regain_s = std::max(outcome.regain_s, out_s);
    outcome.seconds += dt_s;
  }
  outcome.goal_m = (paths[0]->back().map_from_base.translation() - orders.waypoints_m.back()).norm();
  return outcome;
}

std::pair<int, int> seeds() {
  int first = 1000, last = 1002;
  if (const char* wanted = std::getenv("OMNIFLEET_ARENAS")) std::sscanf(wanted, "%d:%d", &first, &last);
  return {first, last};
}

Outcome drive(int seed) {
  const fs::path folder = fs::path(testing::TempDir()) / ("omnifleet_arena_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const std::string overlay = (folder / "seed.yaml").string();
  std::ofstream(overlay) << "world: {seed: " << seed << ", randomised: true}\n";
  InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/demo.yaml";
  run.overlays = {overlay};
  run.out = (folder / "out").string();
  run.log_level = "off";
  runInProcess(run);
  const fleet::Fleet fleet = fleet::Fleet::load(run.fleet_file, {}, run.overlays);
  const auto orders = formation::Formation::Options::read(fleet.service("formation")).command;
  const Outcome outcome = judge(dataset::GroundTruth::load(run.out + "/recording"), orders);
  fs::remove_all(folder);
  return outcome;
}

TEST(Arenas, GoalReachedNothingTouchedFormationRegained) {
  const auto [first, last] = seeds();
  for (int seed = first; seed <= last; ++seed) {
    const Outcome run = drive(seed);
    std::printf(
        "arena %d: %5.1f s, goal %4.1f cm, gap to obstacles %4.1f cm, between robots %4.1f cm, regained in "
        "%.1f s\n",
        seed, run.seconds, 1e2 * run.goal_m, 1e2 * run.gap_m, 1e2 * run.robots_m, run.regain_s);
    EXPECT_LT(run.goal_m, 0.08) << seed;  // arrived_m is 5 cm by its own estimate, then it brakes
    EXPECT_GT(run.gap_m, 0.0) << seed;
    EXPECT_GT(run.robots_m, 0.0) << seed;
    EXPECT_LE(run.regain_s, 10.0) << seed;  // issue 3, point 6
  }
}

}  // namespace
}  // namespace omnifleet::services
