#include "ground/pattern.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/unit/ground/bits.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

Blob blobOf(const cv::Mat1b& mask) {
  const testing::Bits bits(mask);
  return Labeller().label(bits.mask, bits.area, 1).front();
}

/// A floor of uniform brightness with a painted region.
class PatternTest : public ::testing::Test {
 protected:
  using Gain = std::function<double(int, int)>;

  /// @param gain brightness of the pixels of a square of 40 pixels, by column and row
  float turnsOf(const Gain& gain, double noise = 1.5) {
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) image_(kTop + y, kLeft + x) = cv::Vec3b(cv::Vec3d(kFloor) * gain(x, y));
    noisy_ = testing::withNoise(image_, noise, 5);
    mask_(cv::Rect(kLeft, kTop, kSide, kSide)) = 255;
    pattern_.find(blobOf(mask_), frame(noise));
    return pattern_.turns();
  }
  FloorFrame frame(double noise = 1.5) const {
    return {noisy_, floor_, 0.05f, static_cast<float>(4.0 * noise), {80.0f, 60.0f}, view_};
  }

  static constexpr int kSide = 40, kLeft = 96, kTop = 32;
  const cv::Vec3f kFloor = {150, 160, 170};
  cv::Mat3b image_ = cv::Mat3b(120, 160, cv::Vec3b(kFloor)), noisy_;
  cv::Mat3f floor_ = cv::Mat3f(120 / FloorView::kCell, 160 / FloorView::kCell, kFloor);
  cv::Mat1b view_ = cv::Mat1b(120, 160, std::uint8_t{1});
  cv::Mat1b mask_ = cv::Mat1b(120, 160, std::uint8_t{0});
  Pattern pattern_ = Pattern(image_.size());
};

TEST_F(PatternTest, CountsTurnAtEveryPatch) {
  const auto chequers = [](int x, int y) { return (x / 8 + y / 8) % 2 == 0 ? 1.3 : 0.7; };
  EXPECT_NEAR(turnsOf(chequers), 3.0, 0.01);  // five patches a line, four steps
  EXPECT_NEAR(turnsOf(chequers, 8.0), 3.0, 0.01);
}

TEST_F(PatternTest, CountsFewTurnsInShadowsAndPlainFaces) {
  EXPECT_EQ(turnsOf([](int x, int) { return 0.5 + 0.4 * x / kSide; }), 0.0f);
  EXPECT_LE(turnsOf([](int x, int y) { return std::hypot(x - 20, y - 20) < 12 ? 0.3 : 0.7; }), 1.0f);
  EXPECT_LE(turnsOf([](int x, int y) { return y < 15 ? 1.4 : x < 20 ? 0.9 : 0.6; }), 1.0f);
}

/// A pattern in one direction, such as boards of wood or slats of a grid, is no pattern of an object.
TEST_F(PatternTest, IgnoresStripesInOneDirection) {
  EXPECT_EQ(turnsOf([](int x, int) { return x / 4 % 2 == 0 ? 1.2 : 0.8; }), 0.0f);
}

/// The texture of a floor in shadow is finer than any print. None of its pixels may become part of the
/// object.
TEST_F(PatternTest, IgnoresFloorTexture) {
  cv::Mat3b wide(480, 640, cv::Vec3b(kFloor));
  const cv::Rect at(400, 200, kSide, kSide);
  for (int y = at.y; y < at.br().y; ++y)
    for (int x = at.x; x < at.br().x; ++x)
      wide(y, x) = cv::Vec3b(cv::Vec3d(kFloor) * ((x / 2 + y / 2) % 2 == 0 ? 0.8 : 0.5));
  cv::Mat1b mask(wide.size(), std::uint8_t{0}), marks(wide.size(), std::uint8_t{0});
  mask(at) = 255;
  marks(at) = 2;
  const cv::Mat3f floor(480 / FloorView::kCell, 640 / FloorView::kCell, kFloor);
  const cv::Mat1b view(wide.size(), std::uint8_t{1});
  Pattern pattern(wide.size());
  pattern.fill(blobOf(mask), {wide, floor, 0.05f, 6.0f, {320.0f, 240.0f}, view}, 1, 2, marks);
  EXPECT_EQ(cv::countNonZero(marks == 3), 0);
}

TEST_F(PatternTest, IgnoresNoise) {
  EXPECT_EQ(turnsOf([](int, int) { return 0.6; }, 12.0), 0.0f);
}

/// Half of the region is chequered and half is in shadow. Only the chequered half may become core.
TEST_F(PatternTest, FillsPatchesWithoutAdjacentShadow) {
  constexpr std::uint8_t kCore = 1, kShadow = 2;
  constexpr int kPatch = 5, kEnd = 20;  // the left half is chequered, the right one in shadow
  turnsOf([](int x, int y) { return x >= kEnd ? 0.7 : (x / kPatch + y / kPatch) % 2 == 0 ? 0.9 : 0.5; });
  cv::Mat1b marks(mask_.size(), std::uint8_t{0});
  marks.setTo(kShadow, mask_);
  pattern_.fill(blobOf(mask_), frame(), kCore, kShadow, marks);
  int chequered = 0, shadowed = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool is_core = marks(kTop + y, kLeft + x) == (kCore | kShadow);
      chequered += is_core && x < kEnd;
      shadowed += is_core && x >= kEnd;
    }
  }
  EXPECT_GT(chequered, 0.9 * kSide * kEnd);
  EXPECT_EQ(shadowed, 0);
}

}  // namespace
}  // namespace omnifleet::ground
