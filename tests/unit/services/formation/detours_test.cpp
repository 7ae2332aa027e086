// Whole formations at obstacles that cannot be passed with reactive avoidance alone: walls, arcs, pockets,
// mazes. Perfect tracks and scans in the simulated world, commands one frame late. The robots' bodies hide
// the floor as in the demo.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "motion/grid_search.h"
#include "world/drivers.h"

namespace omnifleet::world {
namespace {

const char* const kShapes[] = {"wedge", "column", "line", "triangle"};

struct Room {
  const char* name;
  const char* obstacles;
};

const Room kRooms[] = {
    {"TwoBoxesSideBySide", R"(
  - {kind: box, pose: [0.4, 0.32, 0], size_m: [0.4, 0.5], height_m: 0.2}
  - {kind: box, pose: [0.4, -0.32, 0], size_m: [0.4, 0.5], height_m: 0.2}
)"},
    {"ThreeCylindersInAnArc", R"(
  - {kind: cylinder, pose: [0.6, 0.0, 0], radius_m: 0.15, height_m: 0.2}
  - {kind: cylinder, pose: [0.35, 0.42, 0], radius_m: 0.15, height_m: 0.2}
  - {kind: cylinder, pose: [0.35, -0.42, 0], radius_m: 0.15, height_m: 0.2}
)"},
    {"Wall", "\n  - {kind: box, pose: [0.4, 0.0, 0], size_m: [0.15, 3.0], height_m: 0.2}\n"},
    {"AsymmetricWall", "\n  - {kind: box, pose: [0.4, 0.8, 0.1], size_m: [0.15, 3.6], height_m: 0.2}\n"},
    {"Pocket", R"(
  - {kind: box, pose: [0.9, 0.0, 0], size_m: [0.15, 1.8], height_m: 0.2}
  - {kind: box, pose: [0.4, 0.9, 0], size_m: [1.1, 0.15], height_m: 0.2}
  - {kind: box, pose: [0.4, -0.9, 0], size_m: [1.1, 0.15], height_m: 0.2}
)"},
    {"DeepPocket", R"(
  - {kind: box, pose: [1.6, 0.0, 0], size_m: [0.15, 2.4], height_m: 0.2}
  - {kind: box, pose: [0.4, 1.2, 0], size_m: [2.5, 0.15], height_m: 0.2}
  - {kind: box, pose: [0.4, -1.2, 0], size_m: [2.5, 0.15], height_m: 0.2}
)"},
    {"Chicane", R"(
  - {kind: box, pose: [-0.4, 0.9, 0], size_m: [0.15, 3.0], height_m: 0.2}
  - {kind: box, pose: [1.0, -0.9, 0], size_m: [0.15, 3.0], height_m: 0.2}
)"},
    {"OffsetDoor", R"(
  - {kind: box, pose: [0.4, -0.8, 0], size_m: [0.15, 2.8], height_m: 0.2}
  - {kind: box, pose: [0.4, 2.4, 0], size_m: [0.15, 2.0], height_m: 0.2}
)"},
};

synthetic::Arena arena(const Room& room, const std::string& shape) {
  return synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 150}
floor: {size_m: [8, 8]}
robots:
  r1: {initial_pose: [-2.4, 0.0, 0.0]}
  r2: {initial_pose: [-3.0, 0.42, 0.0]}
  r3: {initial_pose: [-3.0, -0.42, 0.0]}
formation: {shape: )" + shape + R"(, distance_m: 0.75, angle_rad: 0.6, waypoints: [[2.6, 0.1]]}
obstacles:)" + room.obstacles,
                                                        room.name));
}

double leastGap(const World& world) {
  double least_m = INFINITY;
  for (std::size_t i = 0; i < world.arena().robots.size(); ++i) {
    for (const synthetic::Solid& solid : world.arena().solids) {
      const Eigen::Vector2d here_m = world.now().map_from_bases[i].translation();
      least_m = std::min(
          least_m, solid.distance(here_m, solid.map_from_solid) - world.arena().robots[i].body.radius_m);
    }
  }
  return least_m;
}

struct Drive {
  bool leader_arrived = false, all_arrived = false;
  std::size_t collisions = 0;
  double gap_m = INFINITY;  ///< least gap between bodies and obstacles
};

Drive drive(const synthetic::Arena& the_arena) {
  World world(the_arena, {}, 1);
  ObserverOptions observer;
  observer.blind_m = 0.42;
  Drivers drivers(world, observer);
  Drive run;
  while (!world.finished() && !drivers.arrived()) {
    run.collisions += world.step(drivers.commands(world)).collisions.size();
    run.gap_m = std::min(run.gap_m, leastGap(world));
  }
  run.leader_arrived = drivers.states().at("r1").arrived;
  run.all_arrived = drivers.arrived();
  return run;
}

class Detours : public testing::TestWithParam<std::tuple<Room, const char*>> {};

TEST_P(Detours, LeadAllRobotsToTheGoal) {
  const auto& [room, shape] = GetParam();
  const Drive run = drive(arena(room, shape));
  EXPECT_TRUE(run.all_arrived);
  EXPECT_EQ(run.collisions, 0u);
  EXPECT_GT(run.gap_m, motion::Avoidance::Options{}.least_margin_m);
}

INSTANTIATE_TEST_SUITE_P(All, Detours,
                         testing::Combine(testing::ValuesIn(kRooms), testing::ValuesIn(kShapes)),
                         [](const auto& param) {
                           return std::string(std::get<0>(param.param).name) + "_" + std::get<1>(param.param);
                         });

/// Random walls and columns.
std::string randomRoom(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto draw = [&](double least, double most) {
    return least + (most - least) * static_cast<double>(random()) / static_cast<double>(std::mt19937::max());
  };
  std::string obstacles = "\n";
  for (int i = 0; i < 7; ++i) {
    const double x_m = draw(-1.0, 1.9), y_m = draw(-1.8, 1.8), turn_rad = draw(0.0, M_PI);
    obstacles +=
        i % 2 == 0 ? fmt::format("  - {{kind: box, pose: [{}, {}, {}], size_m: [0.15, {}], height_m: 0.2}}\n",
                                 x_m, y_m, turn_rad, draw(0.6, 1.8))
                   : fmt::format("  - {{kind: cylinder, pose: [{}, {}, 0], radius_m: {}, height_m: 0.2}}\n",
                                 x_m, y_m, draw(0.1, 0.25));
  }
  return obstacles;
}

/// Whether a path 80 cm wide leads from the start to the goal, according to ground truth.
bool hasPath(const synthetic::Arena& the_arena) {
  constexpr double kCellM = 0.05, kHalfM = 0.40;
  constexpr int kCells = 160;
  cv::Mat1f price(kCells, kCells, INFINITY);
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const Eigen::Vector2d place_m = kCellM * Eigen::Vector2d(column - kCells / 2, row - kCells / 2);
      const bool is_free =
          std::all_of(the_arena.solids.begin(), the_arena.solids.end(), [&](const synthetic::Solid& solid) {
            return solid.distance(place_m, solid.map_from_solid) > kHalfM;
          });
      if (is_free) price(row, column) = 1.0f;
    }
  }
  const Eigen::Vector2i from(kCells / 2 - 48, kCells / 2), goal(kCells / 2 + 52, kCells / 2 + 2);
  motion::GridSearch search;
  return std::isfinite(price(from.y(), from.x())) && search.find(price, from, goal).reaches;
}

/// If a path leads to the goal, the leader reaches it. Followers whose places are occupied by obstacles may
/// be left behind.
TEST(RandomRooms, LeaderReachesGoalIfAPathExists) {
  int driven = 0, all = 0;
  for (std::uint32_t seed = 1000; seed < 1024; ++seed) {
    const std::string room = randomRoom(seed);
    const synthetic::Arena the_arena = arena({"Random", room.c_str()}, kShapes[seed % 4]);
    if (!hasPath(the_arena)) continue;
    const Drive run = drive(the_arena);
    EXPECT_TRUE(run.leader_arrived) << seed;
    EXPECT_EQ(run.collisions, 0u) << seed;
    ++driven;
    all += run.all_arrived;
  }
  RecordProperty("driven", driven);
  RecordProperty("all_arrived", all);
  EXPECT_GE(driven, 20);
  EXPECT_GE(all, 0.95 * driven);
}

/// An obstacle around the goal and another around a waypoint before it. The leader skips the waypoint, stops
/// near the goal and does not report arrival.
TEST(Unreachable, WaypointIsSkippedAndGoalNotReportedReached) {
  const synthetic::Arena the_arena = synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 60}
floor: {size_m: [8, 8]}
robots:
  r1: {initial_pose: [-2.4, 0.0, 0.0]}
  r2: {initial_pose: [-3.0, 0.42, 0.0]}
formation: {shape: column, distance_m: 0.75, waypoints: [[0.0, 0.0], [2.0, 0.0]]}
obstacles:
  - {kind: cylinder, pose: [0.0, 0.0, 0], radius_m: 0.3, height_m: 0.2}
  - {kind: cylinder, pose: [2.0, 0.0, 0], radius_m: 0.3, height_m: 0.2}
)",
                                                                                    "unreachable.yaml"));
  World world(the_arena, {}, 1);
  Drivers drivers(world);
  std::size_t collisions = 0;
  while (!world.finished()) collisions += world.step(drivers.commands(world)).collisions.size();
  const motion::FormationState& leader = drivers.states().at("r1");
  EXPECT_EQ(leader.next_waypoint, 1u);
  EXPECT_FALSE(leader.arrived);
  EXPECT_EQ(collisions, 0u);
  const double left_m = (world.now().map_from_bases[0].translation() - Eigen::Vector2d(2.0, 0.0)).norm();
  EXPECT_LT(left_m, 0.3 + 0.15 + 0.35) << "as near as the margins allow";
  EXPECT_LT(std::abs(world.twist(0).forward_mps), 0.02);
}

}  // namespace
}  // namespace omnifleet::world
