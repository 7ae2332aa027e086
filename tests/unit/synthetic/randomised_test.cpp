#include "synthetic/randomised.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::synthetic {
namespace {

Arena base() {
  return Arena::read(options::Section::parse(R"(
floor: {size_m: [7, 4.4]}
obstacles:
  - {kind: box, pose: [0, 2, 0], size_m: [0.2, 0.2], height_m: 0.2}
robots:
  r1: {initial_pose: [-2.4, 0, 0]}
  r2: {initial_pose: [-3.0, 0.4, 0]}
formation: {waypoints: [[-0.5, 0], [2.5, 0]]}
random: {obstacles: [4, 7], passage_m: 0.6, near_m: 1.2}
)",
                                             "base.yaml"));
}

double gap(const Solid& a, const Solid& b) {
  double least = INFINITY;
  const Polygon outline = a.footprint();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d from = outline[i], to = outline[(i + 1) % outline.size()];
    for (int k = 0; k < 20; ++k)
      least = std::min(least, b.distance(from + (to - from) * k / 20.0, b.map_from_solid));
  }
  return least;
}

TEST(Randomised, ReturnsEqualArenasForEqualSeeds) {
  const Arena a = randomised(base(), 12), b = randomised(base(), 12), c = randomised(base(), 13);
  ASSERT_EQ(a.solids.size(), b.solids.size());
  for (std::size_t i = 0; i < a.solids.size(); ++i) {
    EXPECT_EQ(a.solids[i].map_from_solid.vector(), b.solids[i].map_from_solid.vector());
    EXPECT_EQ(a.solids[i].rgb, b.solids[i].rgb);
  }
  EXPECT_EQ(a.floor.rgb, b.floor.rgb);
  EXPECT_EQ(a.robots[0].initial_map_from_base.vector(), b.robots[0].initial_map_from_base.vector());
  EXPECT_NE(a.robots[0].initial_map_from_base.vector(), c.robots[0].initial_map_from_base.vector());
  EXPECT_NE(a.solids[0].map_from_solid.vector(), c.solids[0].map_from_solid.vector());
}

TEST(Randomised, KeepsPassagesInitialPosesAndGoalFree) {
  std::size_t fewest = 99, most = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    const Arena arena = randomised(base(), seed);
    fewest = std::min(fewest, arena.solids.size());
    most = std::max(most, arena.solids.size());
    for (std::size_t i = 0; i < arena.solids.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GE(gap(arena.solids[i], arena.solids[j]), 0.6 - 1e-9) << seed;
      const Solid& solid = arena.solids[i];
      for (const ArenaRobot& robot : arena.robots) {
        // Initial poses are shifted by up to 5 cm per axis before obstacles are placed around them.
        EXPECT_GT(solid.distance(robot.initial_map_from_base.translation(), solid.map_from_solid), 0.15 + 0.2)
            << seed;
      }
      EXPECT_GT(solid.distance({2.5, 0.0}, solid.map_from_solid), 0.44) << seed;
    }
  }
  EXPECT_EQ(fewest, 4u);
  EXPECT_EQ(most, 7u);
}

TEST(Randomised, RejectsArenaWithoutRoom) {
  Arena arena = base();
  arena.random = options::Section::parse("{obstacles: [60, 60], passage_m: 2.0}", "crowded.yaml");
  EXPECT_THROW(randomised(arena, 1), options::Error);
  arena.random = options::Section::parse("{obstacle: [1, 2]}", "typo.yaml");
  EXPECT_THROW(randomised(arena, 1), options::Error);
}

}  // namespace
}  // namespace omnifleet::synthetic
