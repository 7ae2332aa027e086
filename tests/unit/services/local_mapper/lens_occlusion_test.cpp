#include "local_mapper/lens_occlusion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "local_mapper/local_mapper.h"
#include "tests/unit/services/local_mapper/fisheye_scene.h"

namespace omnifleet::local_mapper {
namespace {

using testing::box;

/// A robot drives straight over a patterned floor and past a box. A part of its view may be occluded.
class LensOcclusions : public ::testing::Test {
 protected:
  LensOcclusions() : camera_(testing::fisheyeModel()), mapper_(camera_, {}) {
    scene_.prisms = {{box(1.2, 0.9, 0.2, 0.15, 0.4), 0.12, {40, 40, 200}}};
  }
  /// @param edge_px the image is occluded from this column to the right, which shows the robot's right side
  const LocalMap& see(int edge_px, int grey, double step_m = 0.05) {
    if (sequence_ > 0) x_m_ += step_m;
    cv::Mat3b image = testing::renderScene(scene_, camera_, {x_m_, 0.0, 0.0}, 1);
    pattern(image);
    if (edge_px < image.cols)
      image(cv::Rect(edge_px, 0, image.cols - edge_px, image.rows)).setTo(cv::Scalar(grey, grey, grey));
    Motion wheels;
    wheels.valid = sequence_ > 0;
    wheels.previous_from_current = {step_m, 0.0, 0.0};
    return mapper_.process(testing::frameOf(image, sequence_++), wheels);
  }
  /// Smooth variations of the floor's brightness, fixed to the floor.
  void pattern(cv::Mat3b& image) const {
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        const auto floor = camera_.floorFromPixel({u, v});
        if (!floor || floor->norm() > 4.0) continue;
        const double cloud = std::sin(7.0 * (floor->x() + x_m_)) * std::cos(6.0 * floor->y());
        for (int c = 0; c < 3; ++c)
          image(v, u)[c] = cv::saturate_cast<std::uint8_t>(image(v, u)[c] + 6.0 * cloud);
      }
    }
  }

  static constexpr int kMost = 290, kHalf = 330, kThird = 400, kUnoccluded = 640;
  lens::Camera camera_;
  testing::Scene scene_;
  LocalMapper mapper_;
  double x_m_ = 0.0;
  std::uint32_t sequence_ = 0;
};

/// Bearings −150° to −30° are the robot's right; its left is at +90°.
void expectNothingSeenToTheRight(const LocalMap& map) {
  for (int bearing = 230; bearing <= 310; ++bearing)
    EXPECT_EQ(map.scan.label[static_cast<std::size_t>(bearing)], RayLabel::kInvalid) << bearing;
  EXPECT_NE(map.scan.label[90], RayLabel::kInvalid);
  ASSERT_EQ(map.objects.size(), 1U);
  EXPECT_GT(map.objects[0].contact_m.y(), 0.5);
}

TEST_F(LensOcclusions, DetectsBlackHalfInFirstFrame) {
  const LocalMap& map = see(kHalf, 3);
  ASSERT_EQ(map.state, FrameState::kOk);
  EXPECT_NEAR(mapper_.occludedShare(), 0.5, 0.1);
  expectNothingSeenToTheRight(map);
}

TEST_F(LensOcclusions, DetectsSuddenGreyPartAndItsEnd) {
  see(kUnoccluded, 0);
  EXPECT_EQ(mapper_.occludedShare(), 0.0);
  const LocalMap& map = see(kThird, 100);
  EXPECT_NEAR(mapper_.occludedShare(), 0.3, 0.1);
  expectNothingSeenToTheRight(map);
  for (int k = 0; k < 3; ++k) see(kThird, 100);
  EXPECT_NEAR(mapper_.occludedShare(), 0.3, 0.1);
  const LocalMap& free = see(kUnoccluded, 0);
  EXPECT_EQ(mapper_.occludedShare(), 0.0);
  EXPECT_EQ(free.scan.label[270], RayLabel::kFloorEnd);
}

TEST_F(LensOcclusions, DetectsInitialGreyPartAfterOneMetre) {
  for (int k = 0; k < 8; ++k) see(kThird, 100, 0.1);
  EXPECT_EQ(mapper_.occludedShare(), 0.0) << "may be a wall";
  for (int k = 0; k < 5; ++k) see(kThird, 100, 0.1);
  EXPECT_NEAR(mapper_.occludedShare(), 0.3, 0.1);
}

/// Skin, brighter to one side, with a soft edge: it has no blocks of one colour.
TEST_F(LensOcclusions, DetectsHandOverPartOfView) {
  // The hand hides most of the structure in view; the rest must remain usable.
  scene_.prisms.push_back({box(0.1, -0.8, 0.5, 0.4, 0.3), 0.3, {20, 20, 25}});
  scene_.prisms.push_back({box(-0.7, -0.6, 0.4, 0.4, 0.1), 0.3, {15, 25, 20}});
  for (const double from : {kThird, kHalf, kMost}) {
    mapper_ = LocalMapper(camera_, {});
    sequence_ = 0;
    see(kUnoccluded, 0);
    for (int k = 0; k < 4; ++k) {
      x_m_ += 0.03;
      cv::Mat3b image = testing::renderScene(scene_, camera_, {x_m_, 0.0, 0.0}, 1);
      pattern(image);
      for (int v = 0; v < image.rows; ++v) {
        for (int u = 0; u < image.cols; ++u) {
          const double share = 1.0 / (1.0 + std::exp(-(u - from - 10.0 * std::sin(v / 30.0)) / 3.0));
          const double brightness = 0.5 + 0.4 * (image.cols - u) / (image.cols - from);
          const cv::Vec3d skin = cv::Vec3d(110, 140, 200) * brightness;
          for (int c = 0; c < 3; ++c)
            image(v, u)[c] =
                cv::saturate_cast<std::uint8_t>(share * skin[c] + (1.0 - share) * image(v, u)[c]);
        }
      }
      Motion wheels;
      wheels.valid = true;
      wheels.previous_from_current = {0.03, 0.0, 0.0};
      const LocalMap& map = mapper_.process(testing::frameOf(image, sequence_++), wheels);
      ASSERT_EQ(map.state, FrameState::kOk);
      EXPECT_NEAR(mapper_.occludedShare(), from == kThird ? 0.3 : from == kHalf ? 0.5 : 0.6, 0.1);
      expectNothingSeenToTheRight(map);
    }
    see(kUnoccluded, 0);
    EXPECT_EQ(mapper_.occludedShare(), 0.0);
  }
}

TEST_F(LensOcclusions, IgnoresLightChange) {
  for (int k = 0; k < 3; ++k) see(kUnoccluded, 0);
  scene_.floor = {90, 96, 102};
  scene_.prisms[0].colour = {24, 24, 120};
  see(kUnoccluded, 0);
  EXPECT_EQ(mapper_.occludedShare(), 0.0);
}

/// A lamp on the right is switched off: the brightness changes there, but hues and structure remain.
TEST_F(LensOcclusions, IgnoresShadowOverPartOfView) {
  see(kUnoccluded, 0);
  x_m_ += 0.03;
  cv::Mat3b image = testing::renderScene(scene_, camera_, {x_m_, 0.0, 0.0}, 1);
  pattern(image);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = kThird; u < image.cols; ++u)
      image(v, u) *= 0.4 + 0.4 * (image.cols - u) / (image.cols - kThird);
  }
  Motion wheels;
  wheels.valid = true;
  wheels.previous_from_current = {0.03, 0.0, 0.0};
  mapper_.process(testing::frameOf(image, sequence_++), wheels);
  EXPECT_EQ(mapper_.occludedShare(), 0.0);
}

TEST_F(LensOcclusions, IgnoresGreyObjectBesideRobotAtRest) {
  for (int k = 0; k < 20; ++k) see(kThird, 100, 0.0);
  EXPECT_EQ(mapper_.occludedShare(), 0.0);
}

/// A plain wall on the right, higher than the camera; the end of the room comes nearer.
TEST_F(LensOcclusions, IgnoresWallAlongThePath) {
  scene_.prisms.push_back({box(0.0, -1.0, 5.0, 0.1, 0.0), 0.45, {90, 85, 80}});
  scene_.prisms.push_back({box(2.5, 0.0, 0.1, 2.1, 0.0), 0.45, {90, 85, 80}});
  for (int k = 0; k < 16; ++k) {
    see(kUnoccluded, 0, 0.1);
    EXPECT_EQ(mapper_.occludedShare(), 0.0) << k;
  }
}

}  // namespace
}  // namespace omnifleet::local_mapper
