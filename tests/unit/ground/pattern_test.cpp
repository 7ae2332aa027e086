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

/// A floor of one brightness, on which a region is painted.
class PatternTest : public ::testing::Test {
 protected:
  using Gain = std::function<double(int, int)>;

  /// @param gain of the pixels of a square of 40 pixels, by its columns and rows
  float turnsOf(const Gain& gain, double noise = 1.5) {
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) image_(kTop + y, kLeft + x) = cv::Vec3b(cv::Vec3d(kFloor) * gain(x, y));
    const cv::Mat3b noisy = testing::withNoise(image_, noise, 5);
    mask_(cv::Rect(kLeft, kTop, kSide, kSide)) = 255;
    const FloorFrame frame{noisy, floor_, 0.05f, static_cast<float>(4.0 * noise), {80.0f, 60.0f}, view_};
    return Pattern(image_.cols).turns(blobOf(mask_), frame);
  }

  static constexpr int kSide = 40, kLeft = 96, kTop = 32;
  const cv::Vec3f kFloor = {150, 160, 170};
  cv::Mat3b image_ = cv::Mat3b(120, 160, cv::Vec3b(kFloor));
  cv::Mat3f floor_ = cv::Mat3f(120 / FloorView::kCell, 160 / FloorView::kCell, kFloor);
  cv::Mat1b view_ = cv::Mat1b(120, 160, std::uint8_t{1});
  cv::Mat1b mask_ = cv::Mat1b(120, 160, std::uint8_t{0});
};

TEST_F(PatternTest, BrightnessTurnsAtEveryPatch) {
  const auto chequers = [](int x, int y) { return (x / 8 + y / 8) % 2 == 0 ? 1.3 : 0.7; };
  EXPECT_NEAR(turnsOf(chequers), 3.0, 0.01);  // five patches a line, four steps
  EXPECT_NEAR(turnsOf(chequers, 8.0), 3.0, 0.01);
}

TEST_F(PatternTest, ShadeAndPlainFacesHardlyTurn) {
  EXPECT_EQ(turnsOf([](int x, int) { return 0.5 + 0.4 * x / kSide; }), 0.0f);
  EXPECT_LE(turnsOf([](int x, int y) { return std::hypot(x - 20, y - 20) < 12 ? 0.3 : 0.7; }), 1.0f);
  EXPECT_LE(turnsOf([](int x, int y) { return y < 15 ? 1.4 : x < 20 ? 0.9 : 0.6; }), 1.0f);
}

/// A pattern in one direction, as boards of wood or the slats of a grid are, is none of a thing.
TEST_F(PatternTest, StripesTurnAcrossThemOnly) {
  EXPECT_EQ(turnsOf([](int x, int) { return x / 4 % 2 == 0 ? 1.2 : 0.8; }), 0.0f);
}

TEST_F(PatternTest, NoiseTurnsNothing) {
  EXPECT_EQ(turnsOf([](int, int) { return 0.6; }, 12.0), 0.0f);
}

TEST(PatternFill, IsBetweenTheCoreAlongRowsOrColumns) {
  constexpr std::uint8_t kCore = 1, kShade = 2;
  // 480 columns: patches up to ten pixels wide. A frame of core, open to the right, with shade in it and a
  // shadow below and beside it.
  cv::Mat1b marks(60, 480, std::uint8_t{0});
  marks(cv::Rect(20, 20, 30, 12)) = kShade;
  marks(cv::Rect(20, 20, 11, 2)) = kCore;
  marks(cv::Rect(20, 27, 11, 2)) = kCore;
  marks(cv::Rect(20, 22, 2, 5)) = kCore;
  const cv::Mat1b region = marks != 0, before = marks.clone();
  Pattern(480).fillBetween(blobOf(region), kCore, kShade, marks);
  const cv::Rect between(22, 22, 9, 5);
  for (int y = 20; y < 32; ++y) {
    for (int x = 20; x < 50; ++x) {
      const bool fills = between.contains({x, y});
      EXPECT_EQ(marks(y, x), fills ? kCore | kShade : before(y, x)) << x << ' ' << y;
    }
  }
}

/// What lies farther apart is two things, and what lies between them floor.
TEST(PatternFill, StopsWherePatchesWouldBeTooWide) {
  constexpr std::uint8_t kCore = 1, kShade = 2;
  for (const auto& [apart, fills] : {std::pair{9, true}, std::pair{10, false}}) {
    cv::Mat1b marks(60, 480, std::uint8_t{0});
    marks(cv::Rect(18, 18, apart + 4, apart + 4)) = kCore;
    marks(cv::Rect(20, 20, apart, apart)) = kShade;
    const cv::Mat1b region = marks != 0;
    Pattern(480).fillBetween(blobOf(region), kCore, kShade, marks);
    EXPECT_EQ(marks(24, 24) == (kCore | kShade), fills) << apart;
  }
}

}  // namespace
}  // namespace omnifleet::ground
