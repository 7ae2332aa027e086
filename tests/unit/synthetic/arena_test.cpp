#include "synthetic/arena.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

namespace omnifleet::synthetic {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const char* const kSmall = R"(name: test
frames: {rate_hz: 10, duration_s: 2, start_s: 50}
floor: {size_m: [4, 3]}
walls: {height_m: 0.4, thickness_m: 0.1}
obstacles:
  - {kind: box, pose: [1, 0.5, 0.2], size_m: [0.3, 0.2], height_m: 0.2}
  - {kind: cylinder, pose: [-1, 0.5, 0], radius_m: 0.1, height_m: 0.3, rgb: [1, 2, 3]}
moves:
  - {obstacle: 1, at_s: 1.0, within_s: 0.5, pose: [-1, -0.5, 1.0]}
robots:
  b: {initial_pose: [0, 0, 3.0], waypoints: [[1, 0]]}
  a: {initial_pose: [1, 1, 0], body: {footprint_m: [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]], height_m: 0.2}}
ceiling:
  c1: {camera_model: pinhole, image_width: 64, image_height: 48, focal_px: 50, principal_point_px: [31.5, 23.5], position_m: [0, 0, 3]}
)";

Arena parse(const std::string& text) {
  return Arena::read(options::Section::parse(text, "arena.yaml"));
}

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kSmall;
  text.replace(text.find(from), from.size(), to);
  return text;
}

std::string errorOf(const std::string& text) {
  try {
    parse(text);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Arena, ReadsCompleteFile) {
  const Arena arena = parse(kSmall);
  EXPECT_EQ(arena.frames(), 21);
  EXPECT_EQ(arena.frameTimeNs(3), 50'300'000'000);
  ASSERT_EQ(arena.solids.size(), 6u);
  EXPECT_TRUE(arena.solids[2].wall);
  EXPECT_EQ(arena.solids[1].rgb, (Rgb{1, 2, 3}));
  ASSERT_EQ(arena.robots.size(), 2u);
  EXPECT_EQ(arena.robots[0].name, "a");
  EXPECT_EQ(arena.robots[0].body.radius_m, 0.0);
  EXPECT_EQ(arena.robots[1].body.radius_m, 0.15);
  ASSERT_EQ(arena.cameras.size(), 3u);
  EXPECT_EQ(arena.cameras[0].id, "a/fisheye");
  EXPECT_EQ(arena.cameras[0].model.image_width_px, 1280);  // the default is the camera of the paper
  EXPECT_EQ(arena.cameras[2].id, "ceiling/c1");
  EXPECT_FALSE(arena.has_formation);
}

TEST(Arena, MasksBodyAndSeesBeyondHorizonWithPaperCamera) {
  const lens::Camera camera(paperFisheye());
  EXPECT_TRUE(camera.pixelFromPoint(camera.model().position_m + Eigen::Vector3d(1.0, 0.0, 0.04)).has_value());
  const Eigen::Vector2d rim = *camera.pixelFromPoint({0.15, 0.0, 0.30});
  const double radius_px = (rim - camera.model().principal_point_px).norm();
  EXPECT_GT(camera.model().self_mask_radius_px, radius_px);
  EXPECT_LT(camera.model().self_mask_radius_px, radius_px + 5.0);
}

TEST(Arena, NamesFileLineAndKeyInErrors) {
  EXPECT_THAT(errorOf(replaced("rate_hz: 10", "rate_hz: 0")), HasSubstr("arena.yaml:2: frames.rate_hz"));
  EXPECT_THAT(errorOf(replaced("size_m: [4, 3]", "sise_m: [4, 3]")), HasSubstr("arena.yaml:3"));
  EXPECT_THAT(errorOf(replaced("obstacle: 1,", "obstacle: 2,")), HasSubstr("arena.yaml:9"));
  EXPECT_THAT(errorOf(replaced("kind: cylinder", "kind: sphere")), HasSubstr("arena.yaml:7"));
  EXPECT_THAT(errorOf(replaced("rgb: [1, 2, 3]", "rgb: [1, 2, 300]")), HasSubstr("rgb"));
  EXPECT_THAT(errorOf(replaced("initial_pose: [0, 0, 3.0], ", "")), HasSubstr("initial_pose"));
  EXPECT_THAT(errorOf(replaced("initial_pose: [0, 0, 3.0]", "initial_pose: [0, 99, 3.0]")),
              AllOf(HasSubstr("initial_pose"), HasSubstr("not on the floor")));
  EXPECT_THAT(errorOf(replaced("[0.1, 0.1], [-0.1, 0.1]]", "[0.1, -0.1]]")), HasSubstr("footprint_m"));
  EXPECT_THAT(errorOf("name: empty\n"), HasSubstr("robots"));
  EXPECT_THAT(errorOf(std::string(kSmall) + "wind: 3\n"), HasSubstr("wind"));
}

TEST(Arena, MovesObstacleAtConstantSpeed) {
  const Arena arena = parse(kSmall);
  EXPECT_EQ(arena.solidAt(1, 0.99).vector(), Eigen::Vector3d(-1, 0.5, 0));
  EXPECT_LT((arena.solidAt(1, 1.25).vector() - Eigen::Vector3d(-1, 0.0, 0.5)).norm(), 1e-12);
  EXPECT_LT((arena.solidAt(1, 9.0).vector() - Eigen::Vector3d(-1, -0.5, 1.0)).norm(), 1e-12);
  EXPECT_EQ(arena.solidAt(0, 9.0).x_m, 1.0);
}

TEST(Arena, ListsObstaclesWithoutWallsInTruth) {
  const auto scene = parse(kSmall).truthScene(2.0);
  ASSERT_EQ(scene.size(), 2u);
  EXPECT_NEAR(signedArea(scene[0].outline_m), 0.06, 1e-12);
  EXPECT_LT((scene[0].centroid_m - Eigen::Vector2d(1, 0.5)).norm(), 1e-12);
  EXPECT_NEAR(signedArea(scene[1].outline_m), M_PI * 0.01, 1e-9);
  EXPECT_LT((scene[1].centroid_m - Eigen::Vector2d(-1, -0.5)).norm(), 1e-9);
  EXPECT_EQ(scene[1].height_m, 0.3);
}

TEST(Arena, ReturnsRoomInsideWalls) {
  EXPECT_NEAR(signedArea(parse(kSmall).truthRoom()), 4.0 * 3.0, 1e-12);
  EXPECT_TRUE(parse(replaced("walls: {height_m: 0.4, thickness_m: 0.1}", "")).truthRoom().empty());
}

TEST(Solid, MatchesDistanceToSampledOutline) {
  const Arena arena = parse(kSmall);
  for (int solid = 0; solid < 2; ++solid) {
    const Solid& s = arena.solids[solid];
    // The outline sampled by points. The distance to the nearest one is accurate to half their spacing.
    Polygon points;
    const Polygon outline = s.footprint();
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const Eigen::Vector2d a = outline[i], b = outline[(i + 1) % outline.size()];
      for (int k = 0; k < 200; ++k) points.push_back(a + (b - a) * k / 200.0);
    }
    for (double angle = 0.0; angle < 6.2; angle += 0.4) {
      for (const double way : {0.05, 0.3, 0.9}) {
        const Eigen::Vector2d p =
            s.map_from_solid.translation() + way * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        double nearest = INFINITY;
        for (const Eigen::Vector2d& q : points) nearest = std::min(nearest, (p - q).norm());
        if (contains(outline, p)) nearest = -nearest;
        EXPECT_NEAR(s.distance(p, s.map_from_solid), nearest, 1e-3);
      }
    }
  }
}

TEST(Light, KeepsMinimumBrightness) {
  Light light;
  light.gradient_per_m = {1.0, 0.0};
  EXPECT_EQ(light.at({-50.0, 0.0}, 0.0), 0.05);
  EXPECT_DOUBLE_EQ(light.at({0.5, 0.0}, 0.0), 1.5);
}

TEST(Arena, LoadsEveryArenaFile) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  ASSERT_NE(source, nullptr) << "OMNIFLEET_SOURCE_DIR is not set; ctest sets it";
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(source) + "/config/arenas")) {
    if (entry.path().extension() != ".yaml") continue;
    const Arena arena = Arena::load(entry.path().string());
    EXPECT_TRUE(!arena.cameras.empty() || arena.laser) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 4);
}

}  // namespace
}  // namespace omnifleet::synthetic
