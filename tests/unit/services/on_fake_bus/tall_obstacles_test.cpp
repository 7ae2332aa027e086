// Obstacles higher than the camera, of which only the near side is visible: the whole fleet on a recording.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "evaluate/report.h"
#include "fleet_in_process/in_process.h"
#include "tests/test_data.h"
#include "world/recording.h"

namespace omnifleet {
namespace {

/// r1 drives past two pillars and a low box. The camera is 0.5 m above the floor.
constexpr const char* kRoom =
    "name: pillars\nframes: {rate_hz: 5, duration_s: 14}\nfloor: {size_m: [7.0, 5.0]}\nrobots:\n"
    "  r1: {initial_pose: [-2.0, 0, 0], speeds: [0, 0.22, 0.22]}\n"
    "  r2: {initial_pose: [1.6, -0.4, 2.8], speeds: [0, 0.20, 0.18]}\n"
    "obstacles:\n"
    "  - {kind: box, pose: [-0.6, 0.9, 0.3], size_m: [0.4, 0.4], height_m: 1.2, rgb: [40, 78, 170]}\n"
    "  - {kind: cylinder, pose: [0.5, -1.1, 0], radius_m: 0.15, height_m: 0.8, rgb: [200, 84, 30]}\n"
    "  - {kind: box, pose: [0.9, 1.0, 0.8], size_m: [0.3, 0.2], height_m: 0.2, rgb: [44, 140, 70]}\n"
    "rigs:\n  fisheye:\n    camera_model: fisheye\n    projection: equidistant\n    image_width: 640\n"
    "    image_height: 480\n    focal_px: 148.659\n    principal_point_px: [319.5, 239.5]\n"
    "    fov_deg: 185\n    position_m: [0, 0, 0.5]\n    self_mask_radius_px: 99\n";

TEST(TallObstacles, AreMappedWithoutHeight) {
  test::TempFolder folder;
  const std::string file = folder / "pillars.yaml", data = folder / "pillars";
  std::ofstream(file) << kRoom;
  const auto arena = synthetic::Arena::load(file);
  world::RecordingOptions recording;
  recording.world = world::World::Options::read(arena.world);
  recording.seed = 1000;
  recording.ceiling = false;
  ASSERT_TRUE(world::record(arena, recording, data).collisions.empty());
  services::InProcessRun options;
  options.dataset = data;
  options.out = folder / "out";
  options.log_level = "off";
  ASSERT_TRUE(services::runInProcess(options));
  const auto report = evaluate::evaluateRun(options.out, data);
  std::printf("%s", evaluate::table(report).c_str());
  ASSERT_TRUE(report.map);
  EXPECT_TRUE(report.map->missed.empty());
  EXPECT_TRUE(report.map->falsely_found.empty());
  for (const auto& match : report.map->matches) {
    const double true_m = report.truth[match.truth].height_m,
                 mapped_m = report.objects[match.estimate].height_m;
    if (true_m > 0.5)
      EXPECT_EQ(mapped_m, 0.0) << true_m;
    else
      EXPECT_NEAR(mapped_m, true_m, 0.02);
  }
}

}  // namespace
}  // namespace omnifleet
