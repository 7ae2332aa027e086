#include "ground/horizon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ground/region_growing.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

double degreesOf(const lens::CameraModel& model, int x,
                 int y) {  // equidistant lens: r = f·θ; 90° at the horizon
  const double r = std::hypot(x - model.principal_point_px.x(), y - model.principal_point_px.y());
  return r / model.focal_px.x() * 180.0 / M_PI;
}

TEST(Horizon, ReadsColoursAboveHorizonByBearing) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  Horizon horizon(camera, view);
  cv::Mat3b image(480, 640, cv::Vec3b(10, 20, 30));
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      if (degreesOf(model, x, y) < 90.2) continue;
      image(y, x) = x < 320 ? cv::Vec3b(200, 100, 50) : cv::Vec3b(90, 60, 120);
    }
  }
  horizon.read(image);
  int left = 0, right = 0;
  for (int y = 0; y < view.cells().height; ++y) {
    for (int x = 0; x < view.cells().width; ++x) {
      const int sector = horizon.sectors()(y, x);
      ASSERT_EQ(sector == 0, view.coverage()(y, x) == 0);
      if (sector == 0 || std::abs(4 * x + 1.5 - 319.5) < 40) continue;  // sectors that hold both colours
      const cv::Vec4f& seen = horizon.colours()[static_cast<std::size_t>(sector)];
      if (seen[0] < 0.0f) continue;  // the image ends before the horizon
      const cv::Vec3b expected = 4 * x < 320 ? cv::Vec3b(200, 100, 50) : cv::Vec3b(90, 60, 120);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(seen[c], expected[c], 0.01) << x << " " << y;
      (4 * x < 320 ? left : right) += 1;
    }
  }
  EXPECT_GT(left, 1000);
  EXPECT_GT(right, 1000);
}

TEST(Horizon, ReportsNoColourIfLensEndsBelowHorizon) {
  auto model = testing::fisheye();
  model.fov_deg = 160.0;
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  Horizon horizon(camera, view);
  horizon.read(cv::Mat3b(480, 640, cv::Vec3b(200, 100, 50)));
  for (const cv::Vec4f& seen : horizon.colours()) EXPECT_LT(seen[0], 0.0f);
}

/// Floor everywhere except for a wall on the left. Its colour is near the floor's, and some of the seeds lie
/// on it.
class FloorBesideWallTest : public ::testing::Test {
 protected:
  static constexpr int kSize = 60;  // blocks

  static bool isSeed(int y, int x) { return std::abs(std::hypot(x - 30, y - 30) - 10.0) < 2.5; }
  /// Number of the wall's and the floor's blocks that region growing takes for floor.
  struct Grown {
    int wall = 0, floor = 0;
  };
  struct Scene {
    int blend = 0;       ///< blocks over which the floor's colour changes into the wall's
    double noise = 0.5;  ///< of a block, grey levels
    int wall_ends = 22;  ///< block; some seeds lie on the wall
  };
  static Grown grow(const cv::Vec3f& wall, bool use_beyond, const Scene& scene) {
    const auto isWall = [&](int x) { return x < scene.wall_ends; };
    const cv::Mat1b coverage(kSize, kSize, std::uint8_t{2});
    cv::Mat1b seeds(kSize, kSize, std::uint8_t{0}), sectors(kSize, kSize, std::uint8_t{2});
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        seeds(y, x) = isSeed(y, x) ? 255 : 0;
        if (isWall(x)) sectors(y, x) = 1;
      }
    RegionGrowing growing(coverage, seeds, {0.08, 0.03, 3.0}, 0.002);
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) growing.means()(y, x) = blended(wall, scene.wall_ends - x, scene.blend);
    growing.setBeyondSectors(sectors);
    const cv::Vec4f none = cv::Vec4f::all(-1.0f);
    const std::vector<cv::Vec4f> beyond{none, {wall[0], wall[1], wall[2], 0.0f}, none};
    EXPECT_TRUE(
        growing.grow({scene.noise, scene.noise}, use_beyond ? beyond : std::vector<cv::Vec4f>(3, none)));
    Grown grown;
    for (int y = 1; y + 1 < kSize; ++y)
      for (int x = 1; x + 1 < kSize; ++x)
        (isWall(x) ? grown.wall : grown.floor) += growing.isGrown(y, x) ? 1 : 0;
    return grown;
  }
  static cv::Vec3f blended(const cv::Vec3f& wall, int into, int blend) {
    const float share =
        std::clamp(static_cast<float>(into) / static_cast<float>(std::max(1, blend)), 0.0f, 1.0f);
    return share * wall + (1.0f - share) * kFloor;
  }
  static inline const cv::Vec3f kFloor{150, 166, 170};
};

TEST_F(FloorBesideWallTest, DropsSeedsOnTheWall) {
  // The wall's bin is next to the floor's and its hue is within the noise. Its seeds therefore count as
  // floor.
  const cv::Vec3f wall(150, 155, 175);
  const Grown without = grow(wall, false, {0, 2.0}), with = grow(wall, true, {0, 2.0});
  EXPECT_GT(without.wall, 1000) << "without it region growing must leak onto the wall";
  EXPECT_EQ(with.wall, 0);
  EXPECT_GE(with.floor, without.floor);
}

// Half of the seeds each: their mean is the colour of neither.
TEST_F(FloorBesideWallTest, KeepsFloorsOfTwoHues) {
  const cv::Vec3f other(138, 166, 182);
  const Grown grown = grow(other, false, {0, 0.0, 30});
  EXPECT_GT(grown.floor, 1000);
  EXPECT_GT(grown.wall, 1000);
}

// Along the way each block holds more of the object's hue, none of them much more than the previous one.
TEST_F(FloorBesideWallTest, StopsAtMixedBlocksOfAnotherHue) {
  const cv::Vec3f neutral(161, 161, 161);  // differs from the floor's hue by 6 % of its brightness
  EXPECT_LT(grow(neutral, false, {4, 0.5, 14}).wall, 4 * kSize);
  EXPECT_GT(grow(neutral, false, {14, 0.5, 14}).wall, 700) << "a slow change of the light is followed";
}

TEST_F(FloorBesideWallTest, StopsAtGradualTransitionToTheWall) {
  for (const cv::Vec3f& wall : {cv::Vec3f(150, 140, 180), cv::Vec3f(150, 156, 174)}) {
    const Grown without = grow(wall, false, {10}), with = grow(wall, true, {10});
    EXPECT_GT(without.wall, 1000) << "without it region growing must leak onto the wall";
    EXPECT_LT(with.wall, 7 * kSize) << "at most half of the transition, plus some blocks";
    EXPECT_GT(with.floor, 2000);
  }
}

TEST_F(FloorBesideWallTest, IgnoresWallOfClearlyOtherColour) {
  const cv::Vec3f wall(60, 90, 200);
  const Grown without = grow(wall, false, {}), with = grow(wall, true, {});
  EXPECT_EQ(without.wall, 0);
  EXPECT_EQ(with.wall, 0);
  EXPECT_EQ(with.floor, without.floor);
  EXPECT_GT(with.floor, 2000);
}

}  // namespace
}  // namespace omnifleet::ground
