// Tours: the loop closes, the steps stay within their bounds.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "geometry/polygon.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {
namespace {

FurnishedOptions touring(unsigned seed) {
  FurnishedOptions options;
  options.seed = seed;
  options.frames = 191;
  options.step_min_m = 0.06;
  options.step_max_m = 0.16;
  options.loop = true;
  options.decorated = seed % 2 == 1;
  return options;
}

FurnishedScene tourScene(const FurnishedOptions& options) {
  Random random(options.seed);
  return furnishedScene(options, random);
}

/// Frame at which the robot is back within 15 cm of its first place after it was 1 m away; 0: never. A goal
/// counts as reached within 8 cm, and half a step of 16 cm may lie between it and the nearest frame.
std::size_t firstReturn(const std::vector<DriveFrame>& frames) {
  bool was_away = false;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const double away_m =
        (frames[k].poses.front().translation() - frames.front().poses.front().translation()).norm();
    was_away = was_away || away_m > 1.0;
    if (was_away && away_m < 0.15) return k;
  }
  return 0;
}

TEST(RoomTour, ReturnsToItsFirstPlace) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    const FurnishedScene scene = tourScene(touring(seed));
    ASSERT_EQ(scene.drive.frames.size(), 191U);
    EXPECT_GT(firstReturn(scene.drive.frames), 30U) << "seed " << seed;
  }
}

/// A tick of 0.02 s at 0.25 m/s is 5 mm. Between two images with nearly equal headings the robot drives
/// straight, except for bends of up to 20°, which shorten a step by less than 1 cm.
TEST(RoomTour, StepsVaryWithinTheirBounds) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const std::vector<DriveFrame> frames = tourScene(touring(seed)).drive.frames;
    std::vector<double> straight;
    for (std::size_t k = 1; k < frames.size(); ++k) {
      const Pose2 step = frames[k - 1].poses.front().inverse() * frames[k].poses.front();
      EXPECT_LT(step.translation().norm(), 0.166) << "seed " << seed << ", frame " << k;
      if (std::abs(step.theta_rad) > 20.0 * M_PI / 180.0) continue;
      straight.push_back(step.translation().norm());
      EXPECT_GT(straight.back(), 0.05) << "seed " << seed << ", frame " << k;
    }
    ASSERT_GT(straight.size(), 100U);
    std::sort(straight.begin(), straight.end());
    EXPECT_LT(straight[straight.size() / 10], 0.09) << "seed " << seed;
    EXPECT_GT(straight[straight.size() * 9 / 10], 0.13) << "seed " << seed;
  }
}

TEST(RoomTour, KeepsClearOfWallsAndFurniture) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const FurnishedScene scene = tourScene(touring(seed));
    for (const DriveFrame& frame : scene.drive.frames)
      for (const auto* list : {&scene.house.walls, &scene.house.furniture})
        for (const Solid& solid : *list)
          EXPECT_GT(distanceTo(solid, frame.poses.front().translation()), kRobotRadius_m) << "seed " << seed;
  }
}

TEST(RoomTour, RejectsOptionsThatCannotCloseALoop) {
  FurnishedOptions options = touring(0);
  options.frames = 20;  // 2.2 m of path
  EXPECT_THROW(tourScene(options), std::runtime_error);
  options = touring(0);
  options.robots = 2;
  EXPECT_THROW(tourScene(options), std::runtime_error);
  options = touring(0);
  options.step_min_m = options.step_max_m = 0.0;
  EXPECT_THROW(tourScene(options), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::raycast
