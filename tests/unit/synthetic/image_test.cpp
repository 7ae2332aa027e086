// Properties of rendered images other than contours: floor, light, noise, determinism.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/unit/synthetic/scenes.h"

namespace omnifleet::synthetic {
namespace {

using test::level;

bool equal(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

Arena livelyArena() {
  Arena arena = test::plainArena();
  arena.floor.clouds = 0.05;
  arena.floor.texture = 0.04;
  arena.light.flicker = 0.1;
  arena.light.contact_shadow = 0.2;
  arena.image.noise = 2.0;
  arena.image.shot_noise = 0.1;
  Solid box;
  box.map_from_solid = {0.8, 0.3, 0.3};
  arena.solids = {box};
  arena.moves = {{0, 0.5, 0.0, {-0.8, -0.4, 0.0}}};
  test::addRobot(arena, "r1", {0, 0, 0}, test::smallFisheye());
  test::addRobot(arena, "r2", {0.7, -0.6, 1.0}, test::smallFisheye());
  test::hangCamera(arena, test::ceilingPinhole(2.5));
  return arena;
}

/// Mean and standard deviation of a channel in a window.
std::pair<double, double> statistics(const cv::Mat& bgr, int u0, int v0, int size, int channel) {
  double sum = 0.0, squares = 0.0;
  for (int v = v0; v < v0 + size; ++v) {
    for (int u = u0; u < u0 + size; ++u) {
      sum += level(bgr, u, v, channel);
      squares += level(bgr, u, v, channel) * level(bgr, u, v, channel);
    }
  }
  const double n = size * size, mean = sum / n;
  return {mean, std::sqrt(squares / n - mean * mean)};
}

TEST(Images, RendersEqualImagesInAnyOrder) {
  const Arena arena = livelyArena();
  const std::vector<Pose2> here{{0, 0, 0}, {0.7, -0.6, 1.0}}, there{{0.3, 0.1, 0.4}, {0.5, -0.9, 2.0}};
  for (const char* camera : {"r1/fisheye", "ceiling/c"}) {
    Renderer first(arena, camera, 5), second(arena, camera, 5);
    cv::Mat a, b, c;
    first.render(4, here, a);
    second.render(1, there, b);
    second.render(9, there, c);
    second.render(4, here, b);
    EXPECT_TRUE(equal(a, b)) << camera;
    second.render(5, here, c);
    EXPECT_FALSE(equal(a, c)) << camera;
    Renderer(arena, camera, 6).render(4, here, c);
    EXPECT_FALSE(equal(a, c)) << camera;
  }
}

TEST(Images, MovesContactShadowsWithObstacle) {
  const Arena moved = livelyArena();
  Arena there_at_once = moved;
  there_at_once.solids[0].map_from_solid = moved.moves[0].map_from_solid;
  there_at_once.moves.clear();
  const std::vector<Pose2> here{{0, 0, 0}, {0.7, -0.6, 1.0}};
  Renderer first(moved, "ceiling/c", 5), second(there_at_once, "ceiling/c", 5);
  cv::Mat a, b;
  first.render(1, here, a);
  first.render(9, here, a);
  second.render(9, here, b);
  EXPECT_LE(cv::norm(a, b, cv::NORM_INF), 1.0);
}

TEST(Images, WritesInPlaceAndRejectsOtherBuffers) {
  const Arena arena = livelyArena();
  Renderer renderer(arena, "r1/fisheye", 1);
  std::vector<unsigned char> memory(320 * 240 * 3);
  cv::Mat loan(240, 320, CV_8UC3, memory.data());
  renderer.render(0, {{}, {0.7, -0.6, 1.0}}, loan);
  EXPECT_EQ(loan.data, memory.data());
  cv::Mat small(100, 100, CV_8UC3), grey(240, 320, CV_8UC1);
  EXPECT_THROW(renderer.render(0, {{}, {}}, small), std::runtime_error);
  EXPECT_THROW(renderer.render(0, {{}, {}}, grey), std::runtime_error);
  EXPECT_THROW(renderer.render(0, {{}}, loan), std::runtime_error);
  EXPECT_THROW(Renderer(arena, "r9/fisheye", 1), options::Error);
}

TEST(Images, IsBlackOutsideTheImageCircle) {
  const Arena arena = livelyArena();
  cv::Mat bgr;
  Renderer(arena, "r1/fisheye", 1).render(0, {{}, {0.7, -0.6, 1.0}}, bgr);
  const Eigen::Vector2d centre = arena.cameras[0].model.principal_point_px;
  for (int v = 0; v < bgr.rows; ++v) {
    for (int u = 0; u < bgr.cols; ++u) {
      if ((Eigen::Vector2d(u, v) - centre).norm() > 119.0) {
        ASSERT_EQ(bgr.at<cv::Vec3b>(v, u), cv::Vec3b(0, 0, 0)) << u << " " << v;
      }
    }
  }
}

TEST(Images, AddsNoiseOfConfiguredSigma) {
  Arena arena = test::plainArena();
  arena.floor.rgb = {60, 120, 180};
  arena.image.noise = 2.0;
  arena.image.shot_noise = 0.15;
  test::hangCamera(arena, test::ceilingPinhole(2.0));
  Renderer renderer(arena, "ceiling/c", 3);
  cv::Mat a, b;
  renderer.render(0, {}, a);
  renderer.render(1, {}, b);
  const double levels[] = {180, 120, 60};
  for (int channel = 0; channel < 3; ++channel) {
    const auto [mean, sigma] = statistics(a, 20, 20, 200, channel);
    EXPECT_NEAR(mean, levels[channel], 0.1);  // σ / √40000 = 0.02, plus rounding
    // Rounding to integer levels adds 1/12 to the variance. 40 000 pixels determine σ to 0.4 %.
    const double expected = std::sqrt(4.0 + 0.0225 * levels[channel] + 1.0 / 12.0);
    EXPECT_NEAR(sigma / expected, 1.0, 0.03);
    double product = 0.0;
    for (int v = 20; v < 220; ++v) {
      for (int u = 20; u < 220; ++u) {
        product += (level(a, u, v, channel) - mean) * (level(b, u, v, channel) - mean) / 40000.0;
      }
    }
    EXPECT_LT(std::abs(product) / (sigma * sigma), 0.02);  // frames are independent: 1/√40000 = 0.005
  }
}

TEST(Images, RendersFloorTextureWithMeanAndContrast) {
  Arena arena = test::plainArena();
  arena.floor.rgb = {150, 150, 150};
  arena.floor.texture = 0.05;
  arena.floor.texture_size_m = 0.02;
  test::hangCamera(arena, test::ceilingPinhole(0.8));  // 3.6 mm per pixel resolves the texture
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 3).render(0, {}, bgr);
  const auto [mean, sigma] = statistics(bgr, 20, 20, 200, 0);
  EXPECT_NEAR(mean, 150.0, 1.5);
  // `texture` is the amplitude. σ of smooth noise in [−1, 1] (times 1.7) is about half of it.
  EXPECT_GT(sigma, 0.3 * 0.05 * 150);
  EXPECT_LT(sigma, 1.0 * 0.05 * 150);
}

TEST(Images, AveragesTextureOfDistantFloor) {
  Arena arena = test::plainArena();
  arena.floor.texture = 0.2;
  test::hangCamera(arena, test::ceilingPinhole(20.0));  // 9 cm per pixel averages the texture
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 3).render(0, {}, bgr);
  EXPECT_LT(statistics(bgr, 20, 20, 200, 0).second, 0.02 * 200);
}

TEST(Images, PlacesGridLinesAtMultiplesOfSpacing) {
  Arena arena = test::plainArena();
  arena.floor.grid_m = 0.25;
  arena.floor.grid_width_m = 0.012;
  arena.floor.grid_rgb = {0, 0, 0};
  test::hangCamera(arena, test::ceilingPinhole(1.5));
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 3).render(0, {}, bgr);
  const lens::Camera camera(arena.cameras[0].model);
  for (const double x_m : {-0.25, 0.0, 0.25, 0.5}) {
    for (const double y_m : {-0.65, -0.35, 0.1}) {
      // The u axis of the image is along −y, the v axis along −x. So lines of constant x are rows.
      const Eigen::Vector2d pixel = *camera.pixelFromPoint({x_m, y_m, 0.0});
      const int u = static_cast<int>(std::lround(pixel.x())), v0 = static_cast<int>(std::lround(pixel.y()));
      double sum = 0.0, moment = 0.0;
      for (int v = v0 - 5; v <= v0 + 5; ++v) {
        const double dark = 200.0 - level(bgr, u, v, 0);
        sum += dark;
        moment += dark * v;
      }
      // The floor is sampled once per pixel, on texels of almost the same size. So the position of a line of
      // 1.8 px is accurate to 0.1 px.
      EXPECT_NEAR(moment / sum, pixel.y(), 0.1) << x_m << " " << y_m;
      EXPECT_NEAR(sum / 200.0, 0.012 * 220.0 / 1.5, 0.1);
    }
  }
}

TEST(Images, VariesLightOverRoomAndTime) {
  Arena arena = test::plainArena();
  arena.floor.rgb = {100, 100, 100};
  arena.light.gradient_per_m = {0.2, 0.0};
  arena.light.flicker = 0.2;
  arena.light.flicker_period_s = 4.0;
  test::hangCamera(arena, test::ceilingPinhole(2.0));
  Renderer renderer(arena, "ceiling/c", 3);
  const lens::Camera camera(arena.cameras[0].model);
  cv::Mat bgr;
  for (const int frame : {0, 5, 15}) {
    renderer.render(frame, {}, bgr);
    const double expected = 1.0 + 0.2 * std::sin(2.0 * M_PI * (frame / arena.rate_hz) / 4.0);
    for (const double x_m : {-0.6, 0.3, 0.8}) {
      const Eigen::Vector2d pixel = *camera.pixelFromPoint({x_m, 0.1, 0.0});
      const double value = level(bgr, std::lround(pixel.x()), std::lround(pixel.y()), 1);
      EXPECT_NEAR(value, 100.0 * (1.0 + 0.2 * x_m) * expected, 1.0);
    }
  }
}

TEST(Images, MovesObstacleAtConfiguredTime) {
  Arena arena = livelyArena();
  arena.image.noise = arena.image.shot_noise = 0.0;
  Renderer renderer(arena, "ceiling/c", 1);
  const lens::Camera camera(arena.cameras.back().model);
  const auto red = [&](const cv::Mat& bgr, const Eigen::Vector2d& place_m) {
    const Eigen::Vector2d pixel =
        *camera.pixelFromPoint({place_m.x(), place_m.y(), arena.solids[0].height_m});
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    return level(bgr, u, v, 2) - level(bgr, u, v, 0) > 60;
  };
  cv::Mat bgr;
  renderer.render(2, {{}, {0.7, -0.6, 1.0}}, bgr);
  EXPECT_TRUE(red(bgr, {0.8, 0.3}));
  EXPECT_FALSE(red(bgr, {-0.8, -0.4}));
  renderer.render(3, {{}, {0.7, -0.6, 1.0}}, bgr);
  EXPECT_FALSE(red(bgr, {0.8, 0.3}));
  EXPECT_TRUE(red(bgr, {-0.8, -0.4}));
}

TEST(Images, DarkensFacesAwayFromLamp) {
  Arena arena = test::plainArena();
  arena.light.ambient = 0.4;
  arena.light.sun = {1.0, 0.0, 1.0};
  Solid box;
  box.map_from_solid = {-0.8, 0.0, 0.0};
  box.texture = 0.0;
  box.rgb = {100, 100, 100};
  arena.solids = {box};
  test::addRobot(arena, "r1", {}, test::smallFisheye());
  cv::Mat bgr;
  Renderer(arena, "r1/fisheye", 1).render(0, {{}}, bgr);
  const lens::Camera camera(arena.cameras[0].model);
  const Eigen::Vector2d lit = *camera.pixelFromPoint({-0.7, 0.0, 0.1});
  const Eigen::Vector2d top = *camera.pixelFromPoint({-0.8, 0.0, 0.2});
  // This side faces the camera and the lamp, both at 45°, like the top. So it is as bright as the top: full
  // light.
  EXPECT_NEAR(level(bgr, std::lround(lit.x()), std::lround(lit.y()), 0), 100.0, 1.0);
  EXPECT_NEAR(level(bgr, std::lround(top.x()), std::lround(top.y()), 0), 100.0, 1.0);
  cv::Mat behind;
  Renderer(arena, "r1/fisheye", 1).render(0, {{-1.6, 0.0, 0.0}}, behind);
  const Eigen::Vector2d dark = *camera.pixelFromPoint({0.7, 0.0, 0.1});
  EXPECT_NEAR(level(behind, std::lround(dark.x()), std::lround(dark.y()), 0), 40.0, 1.0);
}

TEST(Images, AppliesVignettingAndBlur) {
  Arena arena = test::plainArena();
  arena.image.vignetting = 0.4;
  test::hangCamera(arena, test::ceilingPinhole(2.0));
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 1).render(0, {}, bgr);
  EXPECT_NEAR(level(bgr, 160, 120, 0), 200.0, 1.0);
  EXPECT_NEAR(level(bgr, 160, 0, 0), 200.0 * 0.6, 2.0);

  arena.image.vignetting = 0.0;
  arena.solids = {Solid{}};
  arena.solids[0].rgb = {0, 0, 0};
  arena.solids[0].size_m = {1.0, 1.0};
  cv::Mat sharp, blurred, again;
  Renderer(arena, "ceiling/c", 1).render(0, {}, sharp);
  arena.image.blur_px = 2.0;
  Renderer renderer(arena, "ceiling/c", 1);
  renderer.render(0, {}, blurred);
  renderer.render(0, {}, again);
  EXPECT_TRUE(equal(blurred, again));
  int sharp_grey = 0, blurred_grey = 0;
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      sharp_grey += level(sharp, u, v, 0) > 10 && level(sharp, u, v, 0) < 190;
      blurred_grey += level(blurred, u, v, 0) > 10 && level(blurred, u, v, 0) < 190;
    }
  }
  EXPECT_GT(blurred_grey, 4 * sharp_grey);
}

}  // namespace
}  // namespace omnifleet::synthetic
