// Forward cameras against closed forms: contours of walls, blocks and other robots, the horizon, the camera's
// own robot, markers of kind cover_tail_head.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "synthetic/arena.h"
#include "tests/unit/synthetic/scenes.h"

namespace omnifleet::synthetic {
namespace {

using test::level;

/// 90° wide, 12° down, 8.5 cm above the floor.
lens::CameraModel frontPinhole() {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 320;
  model.image_height_px = 240;
  model.focal_px = {160.0, 160.0};
  model.principal_point_px = {159.5, 119.5};
  model.distortion = {-0.03, 0.005, 0.0, 0.0, 0.0};
  model.position_m = {0.088, 0.0, 0.085};
  model.rotation_rpy_deg = {0.0, -78.0, 0.0};
  return model;
}

RobotBody lowBody() {
  RobotBody body;
  body.footprint_m = {{-0.072, -0.06}, {0.088, -0.06}, {0.088, 0.06}, {-0.072, 0.06}};
  body.height_m = 0.10;
  return body;
}

void addLowRobot(Arena& arena, const std::string& name, const Pose2& pose) {
  ArenaRobot robot;
  robot.name = name;
  robot.body = lowBody();
  robot.initial_map_from_base = pose;
  robot.rgb = {0, 0, 0};
  robot.texture = 0.0;
  arena.robots.push_back(robot);
  arena.cameras.push_back({name + "/front", name, frontPinhole()});
}

Solid blackBox(const Pose2& pose, const Eigen::Vector2d& size_m, double height_m) {
  Solid box;
  box.map_from_solid = pose;
  box.size_m = size_m;
  box.height_m = height_m;
  box.rgb = {0, 0, 0};
  box.texture = 0.0;
  return box;
}

// The pixels below the horizon have level 200 (floor) or 0 (solids).
TEST(FrontCamera, ShowsBlocksWallsAndOtherRobotsWhereTheyStand) {
  Arena arena = test::plainArena();
  const Pose2 own{0.1, -0.05, 0.4}, other{0.75, 0.15, -2.0};
  addLowRobot(arena, "r1", own);
  addLowRobot(arena, "r2", other);
  arena.solids = {blackBox({0.9, 0.7, 0.3}, {0.2, 0.08}, 0.2),
                  blackBox({1.6, 0.0, 1.5707963}, {3.0, 0.04}, 0.22)};
  cv::Mat bgr;
  Renderer(arena, "r1/front", 1).render(0, {own, other}, bgr);
  std::vector<Solid> truth = arena.solids;  // and the body of r2, whose middle lies 8 mm before base_link
  truth.push_back(blackBox(other * Pose2{0.008, 0.0, 0.0}, {0.16, 0.12}, 0.10));
  const lens::Camera camera(frontPinhole());
  int contour = 0;
  double sum = 0.0, worst = 0.0;
  for (int v = 0; v < bgr.rows; ++v) {
    for (int u = 0; u < bgr.cols; ++u) {
      const auto ray = camera.rayFromPixel({double(u), double(v)});
      ASSERT_TRUE(ray);
      if (ray->z() > -0.01) continue;
      const double covered = 1.0 - level(bgr, u, v, 0) / 200.0;
      const double rough = test::trueCoverage(truth, camera, own, u, v, 3);
      if ((rough == 0.0 || rough == 1.0) && std::abs(covered - rough) < 0.01) continue;
      const double error = covered - test::trueCoverage(truth, camera, own, u, v, 24);
      ++contour;
      sum += error;
      worst = std::max(worst, std::abs(error));
    }
  }
  EXPECT_GT(contour, 200);
  EXPECT_LT(std::abs(sum / contour), 0.01);  // a bias would shift every contour
  EXPECT_LT(worst, 0.2);                     // 16 rays per pixel
}

TEST(FrontCamera, ShowsHorizonTwelveDegreesAboveAxis) {
  Arena arena = test::plainArena();
  addLowRobot(arena, "r1", {});
  cv::Mat bgr;
  Renderer(arena, "r1/front", 1).render(0, {Pose2{}}, bgr);
  const double predicted = lens::Camera(frontPinhole()).pixelFromPoint({1e6, 0.0, 0.085}).value().y();
  EXPECT_LT(predicted,
            119.5 - 160.0 * std::tan(12.0 * M_PI / 180.0) + 0.2);  // distortion moves it by < 0.2 px
  int first = 0;
  while (level(bgr, 159, first, 0) != 200.0) ++first;
  // The floor is rendered up to a range of 200 m, 0.07 px below the horizon.
  EXPECT_NEAR(first, std::ceil(predicted + 0.07), 1.0);
  // The distortion bends the horizon by less than two pixels. The own body is not visible below it.
  for (int v = first + 2; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u) ASSERT_EQ(level(bgr, u, v, 0), 200.0) << u << ' ' << v;
}

TEST(CoverTailHead, HeadLiesOnTailAndTailOnCover) {
  Arena arena = test::plainArena();
  addLowRobot(arena, "r1", {0.2, 0.1, 0.6});
  dataset::MarkerSet set;
  set.kind = dataset::MarkerKind::kCoverTailHead;
  set.height_m = 0.10;
  set.cover_size_m = {0.14, 0.11};
  set.tail_offset_m = {-0.02, 0.0};
  set.tail_size_m = {0.05, 0.08};
  set.head_offset_m = {0.02, 0.0};
  set.head_size_m = {0.05, 0.05};  // overlaps the tail
  set.robots["r1"] = {{}, {250, 0, 0}, {0, 250, 0}, {0, 0, 250}};
  arena.markers = set;
  test::hangCamera(arena, test::ceilingPinhole(2.2));
  cv::Mat bgr;
  const Pose2 pose = arena.robots[0].initial_map_from_base;
  Renderer(arena, "ceiling/c", 1).render(0, {pose}, bgr);
  const lens::Camera camera(arena.cameras.back().id == "ceiling/c" ? arena.cameras.back().model
                                                                   : arena.cameras.front().model);
  const auto colourAt = [&](const Eigen::Vector2d& in_base) {
    const Eigen::Vector2d at = pose * in_base;
    const Eigen::Vector2d pixel = camera.pixelFromPoint({at.x(), at.y(), 0.10}).value();
    return bgr.at<cv::Vec3b>(static_cast<int>(std::lround(pixel.y())),
                             static_cast<int>(std::lround(pixel.x())));
  };
  EXPECT_GT(colourAt({0.02, 0.0})[0], 200);   // head: blue
  EXPECT_GT(colourAt({0.0, 0.0})[0], 200);    // head over tail
  EXPECT_GT(colourAt({-0.03, 0.0})[1], 200);  // tail: green
  EXPECT_GT(colourAt({0.058, 0.0})[2], 200);  // cover: red
}

TEST(ArenaFile, SensorsSelectRigsPerRobot) {
  const std::string text = R"(
robots:
  r1: {initial_pose: [0, 0, 0], sensors: [front], initial_pose_known: false, tour: [[0.5, 0], [0, 0.5]]}
  r2: {initial_pose: [1, 0, 0], sensors: []}
  r3: {initial_pose: [1, 1, 0]}
rigs:
  front: {camera_model: pinhole, projection: pinhole, image_width: 32, image_height: 24, focal_px: 16,
          principal_point_px: [15.5, 11.5], position_m: [0.1, 0, 0.1], rotation_rpy_deg: [0, -90, 0]}
)";
  const auto parse = [](const std::string& yaml) {
    return Arena::read(options::Section::parse(yaml, "arena.yaml"));
  };
  const Arena arena = parse(text);
  ASSERT_EQ(arena.cameras.size(), 2u);
  EXPECT_EQ(arena.cameras[0].id, "r1/front");
  EXPECT_EQ(arena.cameras[1].id, "r3/front");
  EXPECT_FALSE(arena.robot("r1").initial_pose_known);
  EXPECT_FALSE(arena.robot("r1").has("wheels"));
  EXPECT_FALSE(arena.robot("r2").has("front"));
  EXPECT_TRUE(arena.robot("r3").has("wheels"));
  std::string unknown = text, missing = text;
  unknown.replace(unknown.find("[front]"), 7, "[radar]");
  missing.replace(missing.find("[front]"), 7, "[laser]");
  EXPECT_THROW(parse(unknown), options::Error);
  EXPECT_THROW(parse(missing), options::Error);
}

TEST(AhmedArenas, KeepWallsAndToursFreeForEverySeed) {
  for (const std::string name : {"ahmed", "ahmed2"}) {
    const Arena arena =
        Arena::load(std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/arenas/" + name + ".yaml");
    const auto fixedOf = [](const Arena& a) {
      return std::count_if(a.solids.begin(), a.solids.end(), [](const Solid& s) { return s.fixed; });
    };
    ASSERT_GT(fixedOf(arena), 8);
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      const Arena varied = randomised(arena, seed);
      EXPECT_EQ(fixedOf(varied), fixedOf(arena));
      EXPECT_GT(varied.solids.size(), static_cast<std::size_t>(fixedOf(arena)) + 4);  // 4 walls, ≥ 1 block
      for (const ArenaRobot& robot : varied.robots) {
        Eigen::Vector2d from = robot.initial_map_from_base.translation();
        for (std::size_t i = 0; i <= robot.tour_m.size() && !robot.tour_m.empty(); ++i) {
          const Eigen::Vector2d to = robot.tour_m[i % robot.tour_m.size()];
          for (int k = 0; k <= 20; ++k)
            for (const Solid& solid : varied.solids)
              ASSERT_GT(solid.distance(from + (to - from) * k / 20.0, solid.map_from_solid), 0.12)
                  << name << ' ' << seed << ' ' << robot.name << ' ' << i;
          from = to;
        }
      }
    }
  }
}

}  // namespace
}  // namespace omnifleet::synthetic
