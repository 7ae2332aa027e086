#include "ground/horizon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ground/floor_growth.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

double degreesOf(const lens::CameraModel& model, int x, int y) {  // equidistant: r = f·θ; 90 at the horizon
  const double r = std::hypot(x - model.principal_point_px.x(), y - model.principal_point_px.y());
  return r / model.focal_px.x() * 180.0 / M_PI;
}

TEST(Horizon, ReadsWhatIsSeenAboveItByBearing) {
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
      if (sector == 0 || std::abs(4 * x + 1.5 - 319.5) < 40) continue;  // sectors that hold both
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

TEST(Horizon, SeesNothingWhereTheLensEndsBelowIt) {
  auto model = testing::fisheye();
  model.fov_deg = 160.0;
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  Horizon horizon(camera, view);
  horizon.read(cv::Mat3b(480, 640, cv::Vec3b(200, 100, 50)));
  for (const cv::Vec4f& seen : horizon.colours()) EXPECT_LT(seen[0], 0.0f);
}

/// Floor all over but for a wall on the left, nearly of its colour, that some of the seeds lie on too.
class BesideAWall : public ::testing::Test {
 protected:
  static constexpr int kSize = 60;  // blocks

  static bool isSeed(int y, int x) { return std::abs(std::hypot(x - 30, y - 30) - 10.0) < 2.5; }
  /// How many of the wall's, and of the floor's blocks the growth takes for floor.
  struct Grown {
    int wall = 0, floor = 0;
  };
  struct Scene {
    int blend = 0;       ///< blocks in which the floor turns into the wall
    double noise = 0.5;  ///< of a block, grey levels
    int wall_ends = 22;  ///< block; some of the seeds are wall
  };
  static Grown grow(const cv::Vec3f& wall, bool look_beyond, const Scene& scene) {
    const auto isWall = [&](int x) { return x < scene.wall_ends; };
    const cv::Mat1b coverage(kSize, kSize, std::uint8_t{2});
    cv::Mat1b seeds(kSize, kSize, std::uint8_t{0}), sectors(kSize, kSize, std::uint8_t{2});
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        seeds(y, x) = isSeed(y, x) ? 255 : 0;
        if (isWall(x)) sectors(y, x) = 1;
      }
    FloorGrowth growth(coverage, seeds, {0.08, 0.03, 3.0}, 0.002);
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) growth.means()(y, x) = blended(wall, scene.wall_ends - x, scene.blend);
    growth.lookBeyond(sectors);
    const cv::Vec4f none = cv::Vec4f::all(-1.0f);
    const std::vector<cv::Vec4f> beyond{none, {wall[0], wall[1], wall[2], 0.0f}, none};
    EXPECT_TRUE(
        growth.grow({scene.noise, scene.noise}, look_beyond ? beyond : std::vector<cv::Vec4f>(3, none)));
    Grown grown;
    for (int y = 1; y + 1 < kSize; ++y)
      for (int x = 1; x + 1 < kSize; ++x)
        (isWall(x) ? grown.wall : grown.floor) += growth.isGrown(y, x) ? 1 : 0;
    return grown;
  }
  static cv::Vec3f blended(const cv::Vec3f& wall, int into, int blend) {
    const float share =
        std::clamp(static_cast<float>(into) / static_cast<float>(std::max(1, blend)), 0.0f, 1.0f);
    return share * wall + (1.0f - share) * kFloor;
  }
  static inline const cv::Vec3f kFloor{150, 166, 170};
};

TEST_F(BesideAWall, SeedsOnItAreNone) {
  // In a bin beside the floor's and of a hue that the noise tolerates: its seeds are taken for floor.
  const cv::Vec3f wall(150, 155, 175);
  const Grown without = grow(wall, false, {0, 2.0}), with = grow(wall, true, {0, 2.0});
  EXPECT_GT(without.wall, 1000) << "else the wall is not taken for floor anyway";
  EXPECT_EQ(with.wall, 0);
  EXPECT_GE(with.floor, without.floor);
}

// Half of the seeds each: their mean is neither's.
TEST_F(BesideAWall, FloorsOfTwoHuesAreFloor) {
  const cv::Vec3f other(138, 166, 182);
  const Grown grown = grow(other, false, {0, 0.0, 30});
  EXPECT_GT(grown.floor, 1000);
  EXPECT_GT(grown.wall, 1000);
}

// Of a thing's hue each block on the way holds more, none of them much more than the one before.
TEST_F(BesideAWall, MixedBlocksDoNotLeadOntoAnotherHue) {
  const cv::Vec3f neutral(161, 161, 161);  // of the floor's hue by 6 % of its brightness
  EXPECT_LT(grow(neutral, false, {4, 0.5, 14}).wall, 4 * kSize);
  EXPECT_GT(grow(neutral, false, {14, 0.5, 14}).wall, 700) << "light that changes is followed";
}

TEST_F(BesideAWall, NoChainOfLikenessesLeadsOntoIt) {
  for (const cv::Vec3f& wall : {cv::Vec3f(150, 140, 180), cv::Vec3f(150, 156, 174)}) {
    const Grown without = grow(wall, false, {10}), with = grow(wall, true, {10});
    EXPECT_GT(without.wall, 1000) << "else the chain breaks anyway";
    EXPECT_LT(with.wall, 7 * kSize) << "half of the way from one to the other, and a little";
    EXPECT_GT(with.floor, 2000);
  }
}

TEST_F(BesideAWall, OneOfQuiteAnotherColourChangesNothing) {
  const cv::Vec3f wall(60, 90, 200);
  const Grown without = grow(wall, false, {}), with = grow(wall, true, {});
  EXPECT_EQ(without.wall, 0);
  EXPECT_EQ(with.wall, 0);
  EXPECT_EQ(with.floor, without.floor);
  EXPECT_GT(with.floor, 2000);
}

}  // namespace
}  // namespace omnifleet::ground
