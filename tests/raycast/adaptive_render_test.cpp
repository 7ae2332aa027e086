// The faster sampler agrees with the exact one.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "tests/raycast/adaptive_render.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {
namespace {

FurnishedScene sampledScene(unsigned seed, bool decorated) {
  FurnishedOptions options;
  options.seed = seed;
  options.width_px = 640;
  options.height_px = 480;
  options.frames = 1;
  options.decorated = decorated;
  Random random(seed);
  return furnishedScene(options, random);
}

/// A pixel whose four samples miss what its middle and its neighbours meet differs; so does one beside the
/// edge of the image circle, which render() leaves black if one sample is outside.
TEST(AdaptiveRenderer, AgreesWithFourSamplesPerPixel) {
  for (const bool decorated : {false, true}) {
    FurnishedScene scene = sampledScene(21, decorated);
    scene.room.noise = 0.0;
    scene.room.floor = Floor::kPlain;
    const Pose2 robot = scene.drive.frames.front().poses.front();
    const cv::Mat3b exact = render(scene.room, scene.camera, robot, {}, 0),
                    quick = AdaptiveRenderer(scene.room, scene.camera).render(robot, {}, 0);
    int seen = 0, unlike = 0;
    double sum = 0.0;
    for (int v = 0; v < exact.rows; ++v) {
      for (int u = 0; u < exact.cols; ++u) {
        if (exact(v, u) == cv::Vec3b(0, 0, 0)) continue;
        ++seen;
        int most = 0;
        for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(exact(v, u)[c] - quick(v, u)[c]));
        unlike += most > 4 ? 1 : 0;
        sum += quick(v, u)[1] - exact(v, u)[1];
      }
    }
    EXPECT_GT(seen, 100000);
    EXPECT_LT(unlike, 0.002 * seen) << (decorated ? "decorated" : "plain");
    EXPECT_NEAR(sum / seen, 0.0, 0.1);
  }
}

TEST(AdaptiveRenderer, AddsTheStatedNoise) {
  FurnishedScene scene = sampledScene(22, false);
  scene.room.floor = Floor::kPlain;
  scene.room.light = 0.4;  // no value saturates
  const Pose2 robot = scene.drive.frames.front().poses.front();
  const AdaptiveRenderer renderer(scene.room, scene.camera);
  const cv::Rect part(200, 150, 240, 180);  // within the image circle
  cv::Mat difference;
  cv::subtract(renderer.render(robot, {}, 0)(part), renderer.render(robot, {}, 1)(part), difference,
               cv::noArray(), CV_32F);
  cv::Scalar mean, sigma;
  cv::meanStdDev(difference, mean, sigma);
  const double rounding = 1.0 / std::sqrt(12.0), expected = std::sqrt(2.0) * std::hypot(1.5, rounding);
  EXPECT_NEAR(sigma[0], expected, 0.05);  // 43200 samples: 0.4 %; the table of 65536 numbers as much
  EXPECT_NEAR(mean[0], 0.0, 0.03);
}

}  // namespace
}  // namespace omnifleet::raycast
