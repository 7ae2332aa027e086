// Whole fleets with rendered cameras and all stages, in seeded arenas. Each run must reach its goal without
// collisions, regain the formation after an obstacle, and keep it to 3 cm where nothing disturbs it.
// Evaluated with the ground truth that the world writes and geometry of its own. OMNIFLEET_ARENAS=FIRST:LAST
// selects the seeds of the arenas, which alternate between the four shapes. The default is one arena and one
// shape straight ahead; the slow tests run all.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "dataset/ground_truth.h"
#include "fleet_in_process/in_process.h"
#include "formation/formation.h"
#include "motion/formation_law.h"

namespace omnifleet::services {
namespace {

namespace fs = std::filesystem;

constexpr double kRadiusM = 0.15;   // m, the demo's robots
constexpr double kInPlaceM = 0.15;  // m, half a body; larger errors are out of formation
constexpr int kSteadySeeds = 1;
constexpr double kNearM =
    0.45;  // m, obstacles within this distance of a robot or its place disturb it: body, margin, reserve

struct Outcome {
  double goal_m = INFINITY;    ///< m, from the leader to the goal at the end
  double gap_m = INFINITY;     ///< m, least gap between bodies and obstacles
  double robots_m = INFINITY;  ///< m, least gap between bodies
  double regain_s = 0.0;       ///< longest time out of place with no obstacle near
  double seconds = 0.0;        ///< duration of the run
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

/// Evaluates one run with its ground truth. `command`: command of the formation.
Outcome evaluate(const dataset::GroundTruth& truth, const motion::FormationCommand& command) {
  Outcome outcome;
  std::vector<const std::vector<dataset::StampedPose>*> paths;
  for (const auto& [robot, path] : truth.trajectories) paths.push_back(&path);
  const std::size_t frames = paths.front()->size();
  const std::vector<Eigen::Vector2d> places = motion::placesOf(command, paths.size());
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
  outcome.goal_m = (paths[0]->back().map_from_base.translation() - command.waypoints_m.back()).norm();
  return outcome;
}

/// RMS distance of a follower from its place beside the leader, while the leader is on its last two metres at
/// full speed.
double steadyRms(const dataset::GroundTruth& truth, const motion::FormationCommand& command,
                 std::size_t follower) {
  std::vector<const std::vector<dataset::StampedPose>*> paths;
  for (const auto& [robot, path] : truth.trajectories) paths.push_back(&path);
  const Eigen::Vector2d place_m = motion::placesOf(command, paths.size())[follower];
  double squares = 0.0;
  int n = 0;
  for (std::size_t f = 0; f < paths[0]->size(); ++f) {
    const Pose2& leader = (*paths[0])[f].map_from_base;
    const double left_m = (command.waypoints_m.back() - leader.translation()).norm();
    if (left_m < 0.6 || left_m > 2.6) continue;
    squares += ((*paths[follower])[f].map_from_base.translation() - leader * place_m).squaredNorm();
    ++n;
  }
  EXPECT_GT(n, 30);
  return std::sqrt(squares / n);
}

std::pair<int, int> seeds() {
  int first = 1000, last = 1000;
  if (const char* wanted = std::getenv("OMNIFLEET_ARENAS")) std::sscanf(wanted, "%d:%d", &first, &last);
  return {first, last};
}

const char* const kShapes[] = {"line", "column", "wedge", "triangle"};

/// Ground truth and command of one run of a fleet.
struct Driven {
  dataset::GroundTruth truth;
  motion::FormationCommand command;
};

/// `files`: by name, written to a folder of their own. One is overlay.yaml; fleet.yaml replaces that of the
/// demo.
Driven drive(const std::map<std::string, std::string>& files) {
  const fs::path folder = fs::path(testing::TempDir()) / ("omnifleet_arena_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  for (const auto& [name, text] : files) std::ofstream(folder / name) << text;
  InProcessRun run;
  run.fleet_file = files.count("fleet.yaml")
                       ? (folder / "fleet.yaml").string()
                       : std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/demo.yaml";
  run.overlays = {(folder / "overlay.yaml").string()};
  run.out = (folder / "out").string();
  run.log_level = "off";
  runInProcess(run);
  const fleet::Fleet fleet = fleet::Fleet::load(run.fleet_file, {}, run.overlays);
  const Driven driven{dataset::GroundTruth::load(run.out + "/recording"),
                      formation::Formation::Options::read(fleet.service("formation")).command};
  fs::remove_all(folder);
  return driven;
}

Outcome driveArena(int seed, const std::string& shape, const std::string& more = "") {
  const Driven run = drive(
      {{"overlay.yaml", "world: {seed: " + std::to_string(seed) +
                            ", randomised: true}\nservices: {formation: {shape: " + shape + more + "}}\n"}});
  const Outcome outcome = evaluate(run.truth, run.command);
  std::printf(
      "arena %d %s%s: %5.1f s, goal %4.1f cm, gap to obstacles %4.1f cm, between robots %4.1f cm, regained "
      "in "
      "%.1f s\n",
      seed, shape.c_str(), more.c_str(), outcome.seconds, 1e2 * outcome.goal_m, 1e2 * outcome.gap_m,
      1e2 * outcome.robots_m, outcome.regain_s);
  std::fflush(stdout);
  EXPECT_LT(outcome.goal_m, 0.08) << seed;  // arrived_m is 5 cm by its own estimate; then it brakes
  EXPECT_GT(outcome.gap_m, 0.0) << seed;
  EXPECT_GT(outcome.robots_m, 0.0) << seed;
  return outcome;
}

TEST(Arenas, ReachGoalWithoutCollisionAndRegainFormation) {
  const auto [first, last] = seeds();
  for (int seed = first; seed <= last; ++seed)
    EXPECT_LE(driveArena(seed, kShapes[seed % 4]).regain_s, 10.0) << seed;  // issue 3, point 6
}

/// As in the paper: followers know the other robots only from their own cameras.
TEST(Arenas, ReachGoalWithOwnCamerasOnly) {
  EXPECT_LE(driveArena(1002, "wedge", ", published_poses: false").regain_s, 10.0);
}

class SteadyWithCameras : public testing::TestWithParam<const char*> {};

const char* const kStraight = R"(
frames: {rate_hz: 5, duration_s: 40}
floor: {size_m: [8.0, 5.0], clouds: 0.05, texture: 0.04}
obstacles:
  - {kind: box, pose: [-1.9, 1.45, 0.3], size_m: [0.34, 0.22], height_m: 0.20, rgb: [190, 52, 40]}
  - {kind: cylinder, pose: [-1.2, -1.40, 0], radius_m: 0.13, height_m: 0.24, rgb: [40, 78, 170]}
  - {kind: box, pose: [-0.1, 1.50, 0.8], size_m: [0.24, 0.24], height_m: 0.16, rgb: [214, 160, 30]}
  - {kind: cylinder, pose: [0.6, -1.45, 0], radius_m: 0.15, height_m: 0.18, rgb: [44, 140, 70]}
  - {kind: box, pose: [1.6, 1.45, -0.4], size_m: [0.40, 0.18], height_m: 0.14, rgb: [150, 60, 150]}
  - {kind: box, pose: [2.3, -1.40, 0.1], size_m: [0.20, 0.30], height_m: 0.22, rgb: [30, 120, 130]}
robots:
  r1: {initial_pose: [-2.40, 0.00, 0.0]}
  r2: {initial_pose: [-3.00, 0.42, 0.0]}
  r3: {initial_pose: [-3.00, -0.42, 0.0]}
formation: {shape: SHAPE, distance_m: 0.75, angle_rad: 0.6, waypoints: [[2.6, 0.0]]}
)";

TEST_P(SteadyWithCameras, KeepsThreeCentimetresRmsStraightAhead) {
  std::string arena = kStraight;
  arena.replace(arena.find("SHAPE"), 5, GetParam());
  double most_m = 0.0;
  for (int seed = 1000; seed < 1000 + kSteadySeeds; ++seed) {
    const Driven run = drive({{"arena.yaml", arena},
                              {"fleet.yaml", "name: straight\nworld: {arena: arena.yaml}\n"},
                              {"overlay.yaml", "world: {seed: " + std::to_string(seed) + "}\n"}});
    for (std::size_t follower = 1; follower < 3; ++follower) {
      const double rms_m = steadyRms(run.truth, run.command, follower);
      std::printf("%s %d: r%zu %.2f cm RMS\n", GetParam(), seed, follower + 1, 1e2 * rms_m);
      most_m = std::max(most_m, rms_m);
    }
  }
  EXPECT_LE(most_m, 0.03);  // issue 3, point 6
}

std::vector<const char*> shapesStraightOn() {
  if (std::getenv("OMNIFLEET_ARENAS")) return {std::begin(kShapes), std::end(kShapes)};
  return {"wedge"};
}

INSTANTIATE_TEST_SUITE_P(All, SteadyWithCameras, testing::ValuesIn(shapesStraightOn()),
                         [](const auto& shape) { return std::string(shape.param); });

}  // namespace
}  // namespace omnifleet::services
