#include "ground/board_finder.h"

#include <gtest/gtest.h>

#include <cmath>

#include "ground/look.h"

namespace omnifleet::ground {
namespace {

/// A dark thing at the edge of the view, and a long strip along that edge in less light than the floor, which
/// hangs together with it.
class BoardFinderTest : public ::testing::Test {
 protected:
  static constexpr int kEdge = 400, kFirst = 391;
  static constexpr float kFloor = 150.0f;
  const cv::Size size_{640, 480};
  const cv::Rect strip_{180, kFirst, 280, kEdge - kFirst}, thing_{460, 370, 24, kEdge - 370};

  BoardFinderTest()
      : image_(size_, cv::Vec3b::all(static_cast<std::uint8_t>(kFloor))),
        floor_(size_.height / FloorView::kCell, size_.width / FloorView::kCell, cv::Vec3f::all(kFloor)),
        looks_(size_, kFloorLook),
        view_(size_, std::uint8_t{0}) {
    view_.rowRange(0, kEdge) = 255;
  }

  /// @param gain_of of the floor's light, at a row of the strip or before it
  template <typename GainOf>
  std::size_t boardsWhere(GainOf gain_of) {
    for (int y = kFirst - 40; y < kEdge; ++y)
      for (int x = strip_.x; x < strip_.br().x; ++x)
        image_(y, x) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(kFloor * gain_of(y)));
    Blob region;
    BitMask things(size_);
    const auto add = [&](const cv::Rect& rect, bool is_thing) {
      for (int y = rect.y; y < rect.br().y; ++y) {
        region.runs.push_back({y, rect.x, rect.br().x});
        if (is_thing) things.set(y, rect.x, rect.br().x);
        for (int x = rect.x; x < rect.br().x; ++x) looks_(y, x) = greyLook(is_thing ? 0.1f : gain_of(y));
      }
      region.area_px += rect.area();
    };
    image_(thing_).setTo(cv::Scalar::all(15));
    add(thing_, true);
    add(strip_, false);
    region.rect = thing_ | strip_;
    std::vector<Strip> strips;
    for (int row = 0; row < floor_.rows; ++row) strips.push_back({row, 0, size_.width});
    BitArea area(size_);
    area.cover(strips);
    BoardFinder finder(size_);
    EXPECT_TRUE(finder.mayBeIn(region, strip_.area()));
    const FloorFrame frame{image_, floor_, 0.02f, 3.0f, {320.0f, 240.0f}, view_};
    return finder.find(region, things, area, frame, looks_).size();
  }

  cv::Mat3b image_;
  cv::Mat3f floor_;
  cv::Mat1b looks_, view_;
};

TEST_F(BoardFinderTest, AWallThatEndsWithTheViewBeginsWithAStep) {
  EXPECT_EQ(boardsWhere([](int y) { return y < kFirst ? 1.0f : 0.7f; }), 1u);
}

/// Lenses show less light there, by degrees.
TEST_F(BoardFinderTest, LessLightTowardsTheEndOfTheViewIsNone) {
  const auto fading = [](int y) {
    return 1.0f - 0.4f * std::pow(static_cast<float>(y - kFirst + 40) / 49.0f, 2.0f);
  };
  EXPECT_EQ(boardsWhere(fading), 0u);
}

}  // namespace
}  // namespace omnifleet::ground
