// Doors, skirting boards and other details: where they are, and that images show them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "tests/raycast/adaptive_render.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {
namespace {

FurnishedScene roomWith(unsigned seed, bool decorated) {
  FurnishedOptions options;
  options.seed = seed;
  options.width_px = 640;
  options.height_px = 480;
  options.frames = 1;
  options.decorated = decorated;
  Random random(seed);
  return furnishedScene(options, random);
}

TEST(RoomDecoration, KeepsFurnitureClearOfDoors) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const House house = roomWith(seed, true).house;
    EXPECT_GE(house.doors.size(), 2U) << "seed " << seed;
    for (const Eigen::Vector2d& door : house.doors)
      for (const Solid& piece : house.furniture) EXPECT_GE(distanceTo(piece, door), 0.8) << "seed " << seed;
    for (const Solid& wall : house.walls)
      for (const Panel& panel : wall.panels)
        EXPECT_LE(std::max(-panel.begin_m, panel.end_m), 0.5 * wall.size_m.maxCoeff()) << "seed " << seed;
  }
}

/// Edges of colour along the ring 3° below the horizon, where walls and furniture are.
int edgesBelowHorizon(const FurnishedScene& scene) {
  Room room = scene.room;
  room.noise = 0.0;
  const cv::Mat3b image =
      AdaptiveRenderer(room, scene.camera).render(scene.drive.frames.front().poses.front(), {}, 0);
  const double radius = scene.camera.focal_px.x() * 87.0 * M_PI / 180.0;
  constexpr int kBearings = 720;
  int edges = 0;
  cv::Vec3b before;
  for (int k = 0; k <= kBearings; ++k) {
    const double angle = 2.0 * M_PI * k / kBearings;
    const cv::Vec3b here =
        image(static_cast<int>(std::lround(scene.camera.principal_point_px.y() + radius * std::sin(angle))),
              static_cast<int>(std::lround(scene.camera.principal_point_px.x() + radius * std::cos(angle))));
    if (k > 0 && cv::norm(here, before, cv::NORM_INF) > 15.0) ++edges;
    before = here;
  }
  return edges;
}

TEST(RoomDecoration, GivesWallsMoreEdges) {
  int plain = 0, decorated = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    plain += edgesBelowHorizon(roomWith(seed, false));
    decorated += edgesBelowHorizon(roomWith(seed, true));
  }
  EXPECT_GT(decorated, 1.3 * plain);
}

}  // namespace
}  // namespace omnifleet::raycast
