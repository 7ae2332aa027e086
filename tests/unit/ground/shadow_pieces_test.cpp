#include "ground/shadow_pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ground/appearance_class.h"

namespace omnifleet::ground {
namespace {

/// A dark object at the border of the view, and a long strip in less light along this border. Both form one
/// region.
class ShadowPiecesTest : public ::testing::Test {
 protected:
  static constexpr int kEdge = 400, kFirst = 391;
  static constexpr float kFloor = 150.0f;
  const cv::Size size_{640, 480};
  const cv::Rect strip_{180, kFirst, 280, kEdge - kFirst}, object_{460, 370, 24, kEdge - 370};

  ShadowPiecesTest()
      : image_(size_, cv::Vec3b::all(static_cast<std::uint8_t>(kFloor))),
        floor_(size_.height / FloorView::kCell, size_.width / FloorView::kCell, cv::Vec3f::all(kFloor)),
        appearances_(size_, kFloorAppearance),
        view_(size_, std::uint8_t{0}) {
    view_.rowRange(0, kEdge) = 255;
  }

  /// @param gain_of brightness relative to the floor, by row; for the strip and the rows before it
  template <typename GainOf>
  std::size_t boardsWhere(GainOf gain_of) {
    for (int y = kFirst - 40; y < kEdge; ++y)
      for (int x = strip_.x; x < strip_.br().x; ++x)
        image_(y, x) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(kFloor * gain_of(y)));
    Blob region;
    BitMask objects(size_);
    const auto add = [&](const cv::Rect& rect, bool is_object) {
      for (int y = rect.y; y < rect.br().y; ++y) {
        region.runs.push_back({y, rect.x, rect.br().x});
        if (is_object) objects.set(y, rect.x, rect.br().x);
        for (int x = rect.x; x < rect.br().x; ++x)
          appearances_(y, x) = greyAppearance(is_object ? 0.1f : gain_of(y));
      }
      region.area_px += rect.area();
    };
    image_(object_).setTo(cv::Scalar::all(15));
    add(object_, true);
    add(strip_, false);
    region.rect = object_ | strip_;
    std::vector<Strip> strips;
    for (int row = 0; row < floor_.rows; ++row) strips.push_back({row, 0, size_.width});
    BitArea area(size_);
    area.cover(strips);
    ShadowPieces finder(size_);
    EXPECT_TRUE(finder.mayBeIn(region, strip_.area()));
    const FloorFrame frame{image_, floor_, 0.02f, 3.0f, {320.0f, 240.0f}, view_};
    finder.find(region, objects, area, frame, appearances_);
    return finder.boards().size();
  }

  cv::Mat3b image_;
  cv::Mat3f floor_;
  cv::Mat1b appearances_, view_;
};

TEST_F(ShadowPiecesTest, FindsBoardThatBeginsWithAStep) {
  EXPECT_EQ(boardsWhere([](int y) { return y < kFirst ? 1.0f : 0.7f; }), 1u);
}

/// Vignetting reduces the light there gradually.
TEST_F(ShadowPiecesTest, RejectsVignettingAsBoard) {
  const auto fading = [](int y) {
    return 1.0f - 0.4f * std::pow(static_cast<float>(y - kFirst + 40) / 49.0f, 2.0f);
  };
  EXPECT_EQ(boardsWhere(fading), 0u);
}

/// A broad piece in less light beside a dark object. The camera's foot is at (320, 240).
class FacesTest : public ::testing::Test {
 protected:
  static constexpr float kFloor = 150.0f;
  /// @param rim_px width of the light transition around the piece
  /// @param foot_px width of the transition on the side of the camera's foot
  std::size_t facesWhere(float rim_px, float foot_px, const cv::Size& piece = {50, 40}) {
    const cv::Size size(640, 480);
    const cv::Rect face({300, 330}, piece), object(face.br().x - 10, 320, 60, 60);
    cv::Mat3b image(size, cv::Vec3b::all(static_cast<std::uint8_t>(kFloor)));
    cv::Mat1b appearances(size, kFloorAppearance);
    Blob region;
    BitMask objects(size);
    for (int y = 300; y < 400; ++y) {
      for (int x = 280; x < object.br().x; ++x) {
        const bool is_object = object.contains({x, y});
        const auto within = [](int from, int at, int to) {
          return static_cast<float>(std::min(at - from, to - 1 - at)) + 0.5f;
        };
        const float around = std::min(within(face.x, x, face.br().x), face.br().y - y - 0.5f);
        const float before = static_cast<float>(y - face.y) + 0.5f;
        const float depth = std::min(std::clamp(around / rim_px + 0.5f, 0.0f, 1.0f),
                                     std::clamp(before / foot_px + 0.5f, 0.0f, 1.0f));
        const float gain = is_object ? 0.1f : 1.0f - 0.4f * depth;
        if (gain > 0.95f) continue;
        image(y, x) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(kFloor * gain));
        appearances(y, x) = greyAppearance(gain);
        region.runs.push_back({y, x, x + 1});
        region.area_px += 1;
        if (is_object) objects.set(y, x, x + 1);
      }
    }
    region.rect = {280, 300, object.br().x - 280, 100};
    std::vector<Strip> strips;
    for (int row = 0; row < size.height / FloorView::kCell; ++row) strips.push_back({row, 0, size.width});
    BitArea area(size);
    area.cover(strips);
    const cv::Mat3f floor(size.height / FloorView::kCell, size.width / FloorView::kCell,
                          cv::Vec3f::all(kFloor));
    ShadowPieces pieces(size);
    if (!pieces.mayBeIn(region, piece.area())) return 0;
    pieces.find(region, objects, area,
                {image, floor, 0.02f, 3.0f, {320.0f, 240.0f}, cv::Mat1b(size, std::uint8_t{255})},
                appearances);
    return pieces.faces().size();
  }
};

TEST_F(FacesTest, FindsFaceSharpExceptAtItsFoot) {
  EXPECT_EQ(facesWhere(1.0f, 14.0f), 1U);
}

TEST_F(FacesTest, RejectsUniformlySharpOrSoftPieces) {
  EXPECT_EQ(facesWhere(1.0f, 1.0f), 0U);
  EXPECT_EQ(facesWhere(14.0f, 14.0f), 0U);
}

TEST_F(FacesTest, RejectsSmallPieces) {
  EXPECT_EQ(facesWhere(1.0f, 14.0f, {24, 24}), 0U);
}

}  // namespace
}  // namespace omnifleet::ground
