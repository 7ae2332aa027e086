// Robots with rectangular bodies, on tours and parked, with few sensors.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "world/body_gaps.h"
#include "world/drivers.h"
#include "world/recording.h"

namespace omnifleet::world {
namespace {

Polygon rectangle(double width_m, double height_m, const Pose2& pose) {
  Polygon corners{{-0.5 * width_m, -0.5 * height_m},
                  {0.5 * width_m, -0.5 * height_m},
                  {0.5 * width_m, 0.5 * height_m},
                  {-0.5 * width_m, 0.5 * height_m}};
  for (Eigen::Vector2d& corner : corners) corner = pose * corner;
  return corners;
}

TEST(BodyGaps, MeasuresGapAndOverlapOfRectangles) {
  const Polygon still = rectangle(0.4, 0.2, {});
  EXPECT_NEAR(gapBetween(still, rectangle(0.2, 0.2, {0.35, 0.0, 0.0})), 0.05, 1e-12);
  EXPECT_NEAR(gapBetween(still, rectangle(0.2, 0.2, {0.25, 0.0, 0.0})), -0.05, 1e-12);
  // Corner to corner: neither has an edge towards the other.
  EXPECT_NEAR(gapBetween(still, rectangle(0.2, 0.2, {0.33, 0.24, 0.0})), 0.05, 1e-12);
  // A square turned by 45° touches the side with its corner.
  const double half_diagonal = 0.1 * std::sqrt(2.0);
  EXPECT_NEAR(gapBetween(still, rectangle(0.2, 0.2, {0.2 + half_diagonal, 0.0, 0.25 * M_PI})), 0.0, 1e-12);
}

synthetic::Arena narrow() {
  return synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 20}
floor: {size_m: [3, 2]}
obstacles:
  - {kind: box, pose: [0.5, 0.2, 0], size_m: [0.4, 0.2], height_m: 0.2}
  - {kind: box, pose: [0.5, -0.2, 0], size_m: [0.4, 0.2], height_m: 0.2}
robots:
  r1: {initial_pose: [0, 0, 0], body: {footprint_m: [[-0.1, -0.06], [0.15, -0.06], [0.15, 0.06], [-0.1, 0.06]],
       height_m: 0.1, wheel_separation_m: 0.1}}
)",
                                                        "narrow.yaml"));
}

World::Options exactWheels() {
  World::Options options;
  options.scale_sigma = 0.0;
  options.noise = 0.0;
  return options;
}

TEST(World, RectangularBodyPassesGapThatItsCircleDoesNot) {
  World world(narrow(), exactWheels(), 1);  // the gap is 20 cm wide, the body 12 cm, its circle 32 cm
  std::size_t contacts = 0;
  for (int i = 0; i < 50; ++i) contacts += world.step({{0.12, 0.12}}).collisions.size();
  EXPECT_EQ(contacts, 0u);
  EXPECT_GT(world.now().map_from_bases[0].x_m, 1.0);
}

TEST(World, RectangularBodyStopsWithItsFrontAtObstacle) {
  synthetic::Arena arena = narrow();
  arena.solids[0].map_from_solid = {0.7, 0.0, 0.0};
  World world(arena, exactWheels(), 1);
  for (int i = 0; i < 30; ++i) world.step({{0.12, 0.12}});
  EXPECT_NEAR(world.now().map_from_bases[0].x_m, 0.5 - 0.15, 0.003);  // an inner step moves by 1.2 mm
}

TEST(World, RectangularBodyCannotTurnInNarrowGap) {
  synthetic::Arena arena = narrow();
  arena.robots[0].initial_map_from_base = {0.5, 0.0, 0.0};
  World world(arena, exactWheels(), 1);
  std::size_t contacts = 0;
  for (int i = 0; i < 30; ++i) contacts += world.step({{-0.05, 0.05}}).collisions.size();
  EXPECT_GT(contacts, 0u);
  EXPECT_LT(world.now().map_from_bases[0].theta_rad, 0.5);
}

class AhmedArena : public testing::TestWithParam<const char*> {
 protected:
  synthetic::Arena arena() const {
    return synthetic::Arena::load(std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/arenas/" +
                                  GetParam() + ".yaml");
  }
};

TEST_P(AhmedArena, RobotsTourWithoutCollision) {
  for (const std::uint32_t seed : {0U, 1U, 2U}) {
    const synthetic::Arena varied = seed == 0 ? arena() : synthetic::randomised(arena(), seed);
    World world(varied, World::Options::read(varied.world), seed);
    Drivers drivers(world);
    std::vector<double> way_m(varied.robots.size(), 0.0);
    while (!world.finished()) {
      const std::vector<Pose2> before = world.now().map_from_bases;
      const World::Driven& driven = world.step(drivers.commands(world));
      ASSERT_TRUE(driven.collisions.empty())
          << seed << ' ' << driven.collisions[0].robot << ' ' << driven.collisions[0].with;
      for (std::size_t i = 0; i < way_m.size(); ++i)
        way_m[i] += (world.now().map_from_bases[i].translation() - before[i].translation()).norm();
    }
    EXPECT_FALSE(drivers.arrived());  // a tour does not end
    EXPECT_GT(way_m[0], 4.0);
    EXPECT_GT(way_m[1], 4.0);
    EXPECT_EQ(way_m[2], 0.0);  // parked
    EXPECT_EQ(way_m[3], 0.0);
  }
}

TEST_P(AhmedArena, RecordingListsParkedRobotsWithoutFolder) {
  synthetic::Arena shortened = arena();
  shortened.duration_s = 0.2;
  const std::string folder = testing::TempDir() + "/omnifleet_ahmed_" + std::to_string(::getpid());
  record(shortened, {}, folder);
  const dataset::Dataset data = dataset::Dataset::open(folder);
  ASSERT_EQ(data.robots.size(), 4u);
  for (const dataset::RobotRecording& robot : data.robots) {
    const bool maps = robot.name < std::string("r3");
    EXPECT_EQ(robot.front.has_value(), maps);
    EXPECT_EQ(std::filesystem::exists(folder + "/" + robot.name), maps);
    EXPECT_FALSE(robot.fisheye);
    EXPECT_FALSE(robot.initial_pose);
    EXPECT_TRUE(robot.wheels.empty());
  }
  EXPECT_EQ(data.ceiling.size(), 2u);
  EXPECT_EQ(dataset::GroundTruth::load(folder).trajectories.at("r4").size(), 2u);
  std::filesystem::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Layouts, AhmedArena, testing::Values("ahmed", "ahmed2"));

}  // namespace
}  // namespace omnifleet::world
