#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>

#include "ground/ground_segmenter.h"
#include "ground/labelling.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// A floor under decreasing light, on which shadows and bright places can be drawn.
class ShadowFilterTest : public ::testing::Test {
 protected:
  ShadowFilterTest()
      : model_(testing::fisheye()),
        camera_(model_),
        view_(camera_, ViewOptions{}),
        image_(testing::unevenFloor(model_, 0.7, 1.5, 11)) {}

  /// Multiplies every pixel by the light share at its distance from a position.
  void shadow(double u, double v, const std::function<double(double)>& light) {
    for (int y = 0; y < image_.rows; ++y) {
      for (int x = 0; x < image_.cols; ++x) {
        const double share = light(std::hypot(x - u, y - v));
        for (int c = 0; c < 3; ++c)
          image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * share);
      }
    }
  }

  std::vector<Blob> blobs(const SegmenterOptions& options = {}) {
    GroundSegmenter segmenter(camera_, view_, options);
    EXPECT_TRUE(segmenter.segment(image_));
    Labeller labeller;
    return labeller.label(segmenter.bits(), segmenter.area(), 20);
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
  cv::Mat3b image_;
};

/// Area of a disc's outline of 1.5 px width, for a radius r: tolerance for rounding.
double ring(double r) {
  return 1.5 * 2.0 * M_PI * r;
}

TEST_F(ShadowFilterTest, RemovesShadowAtTheFootOfAnObject) {
  shadow(480, 330, [](double d) { return d < 16 ? 1.0 : 1.0 - 0.35 * std::exp(-(d - 16) / 12.0); });
  testing::drawDisc<cv::Vec3b>(image_, 480, 330, 16, {30, 30, 190});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, M_PI * 256, ring(16));
  SegmenterOptions without;
  without.shadows = false;
  EXPECT_GT(blobs(without)[0].area_px, M_PI * 256 + 2 * ring(16));  // with shadow the region is larger
}

TEST_F(ShadowFilterTest, RemovesSharpCastShadowBesideBlackObject) {
  shadow(500, 318, [](double d) { return d < 18 ? 0.6 : 1.0; });
  testing::drawDisc<cv::Vec3b>(image_, 480, 330, 16, {22, 20, 20});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, M_PI * 256, ring(16));
}

/// Where an object meets its shadow, both differ strongly from the floor. The border must still be located
/// pixel by pixel.
TEST_F(ShadowFilterTest, SeparatesObjectFromItsDeepShadow) {
  const std::vector<cv::Point2d> places = {{480.2, 330.7}, {161.6, 331.1}, {479.9, 150.4}, {162.3, 151.8}};
  for (const cv::Point2d& at : places) shadow(at.x, at.y, [](double d) { return d < 44 ? 0.5 : 1.0; });
  for (const cv::Point2d& at : places) testing::drawDisc<cv::Vec3b>(image_, at.x, at.y, 26, {110, 40, 50});
  const auto found = blobs();
  ASSERT_EQ(found.size(), places.size());
  double farthest = 0.0;
  for (const Blob& blob : found) {
    for (const ground::Run& run : blob.runs) {
      for (const int x : {run.begin, run.end - 1}) {
        double nearest = 1e9;
        for (const cv::Point2d& at : places)
          nearest = std::min(nearest, std::hypot(x - at.x, run.row - at.y));
        farthest = std::max(farthest, nearest);
      }
    }
  }
  EXPECT_LT(farthest, 26.0 + 1.0);  // of a pixel on the rim
}

/// Object and shadow are in the same brightness range. Only the fact that there are two kinds separates them.
TEST_F(ShadowFilterTest, SeparatesGreyObjectFromShadowOfSimilarDepth) {
  shadow(480, 330, [](double d) { return d < 19 ? 0.78 : d < 36 ? 0.78 + 0.013 * (d - 19) : 1.0; });
  testing::drawDisc<cv::Vec3b>(image_, 480, 330, 17, {46, 50, 53});
  testing::drawDisc<cv::Vec3b>(image_, 483, 327, 8, {38, 41, 44});  // makes the object uneven
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, M_PI * 17 * 17, ring(17));
}

/// A box of the floor's hue to the right of the camera: its side, and behind it its top. Verticals lead away
/// from the camera.
struct GreyBox {
  static constexpr int kBegin = 464, kTop = 494, kEnd = 522;
  static double halfWidth(int x) { return 0.24 * (x - 319.5); }
  static double beside(int x, int y) { return std::abs(y - 239.5) - halfWidth(std::max(x, kBegin)); }
  /// Distance in pixels from the box, before it and beside it.
  static double distance(int x, int y) {
    return std::hypot(std::max(kBegin - x, 0), std::max(beside(x, y), 0.0));
  }
  static void draw(cv::Mat3b& image, double side, double top) {
    for (int y = 0; y < image.rows; ++y)
      for (int x = kBegin; x < kEnd; ++x)
        if (beside(x, y) <= 0.0) dim(image(y, x), x < kTop ? side : top);
  }
  static void dim(cv::Vec3b& pixel, double light) {
    for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(pixel[c] * light);
  }
  static constexpr double kArea_px = 0.24 * (kEnd - kBegin) * (kEnd + kBegin - 2 * 319.5);
  static constexpr double kRing_px = 1.5 * 2 * (kEnd - kBegin + 82);
};

/// The side is darker and the top brighter than the deepest shadow. The shadow lies before the side and
/// beside it.
TEST_F(ShadowFilterTest, RemovesShadowAtTheFootOfAGreyBox) {
  for (int y = 0; y < image_.rows; ++y) {
    for (int x = 0; x < GreyBox::kEnd; ++x) {
      const double d = GreyBox::distance(x, y);
      if (d > 0.0) GreyBox::dim(image_(y, x), std::min(1.0, 0.6 + 0.03 * d));
    }
  }
  GreyBox::draw(image_, 0.32, 0.46);
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, GreyBox::kArea_px, GreyBox::kRing_px);
}

TEST_F(ShadowFilterTest, KeepsBrightSideBeforeDarkTop) {
  GreyBox::draw(image_, 0.58, 0.30);
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, GreyBox::kArea_px, GreyBox::kRing_px);
}

/// Noise of single pixels hides the hue of a dark object on a dark floor. Half of its pixels could be shadow.
TEST_F(ShadowFilterTest, KeepsDarkObjectOnDarkFloorWhole) {
  for (auto& pixel : image_) pixel = cv::Vec3b(47, 55, 64);
  std::mt19937 random(5);
  std::normal_distribution<double> gauss(0.0, 0.1);
  const std::vector<cv::Point2d> places = {{480, 330}, {160, 330}, {480, 150}, {160, 150}};
  for (int y = 0; y < image_.rows; y += 3) {
    for (int x = 0; x < image_.cols; x += 3) {  // spots of different brightness
      const double light = 0.45 + gauss(random);
      for (const cv::Point2d& at : places)
        if (std::hypot(x - at.x, y - at.y) < 26)
          cv::rectangle(image_, {x, y, 3, 3}, cv::Scalar(62 * light, 55 * light, 55 * light), cv::FILLED);
    }
  }
  image_ = testing::withNoise(image_, 2.0, 3);
  const auto found = blobs();
  ASSERT_EQ(found.size(), places.size());
  for (const Blob& blob : found) EXPECT_NEAR(blob.area_px, M_PI * 26 * 26, 2 * ring(26));
}

/// Objects of nearly the floor's hue; parts of them are darker than shadows are.
TEST_F(ShadowFilterTest, KeepsObjectOfNearlyTheFloorsHueWhole) {
  std::mt19937 random(5);
  std::normal_distribution<double> gauss(0.0, 0.06);
  const std::vector<cv::Point2d> places = {{480, 330}, {160, 330}, {480, 150}, {160, 150}};
  for (int y = 0; y < image_.rows; y += 4) {
    for (int x = 0; x < image_.cols; x += 4) {
      const double light = 0.42 + gauss(random);
      for (const cv::Point2d& at : places)
        if (std::hypot(x - at.x, y - at.y) < 22)
          cv::rectangle(image_, {x, y, 4, 4}, cv::Scalar(126 * light + 8, 136 * light, 146 * light - 8),
                        cv::FILLED);
    }
  }
  image_ = testing::withNoise(image_, 1.5, 3);
  const auto found = blobs();
  ASSERT_EQ(found.size(), places.size());
  for (const Blob& blob : found) EXPECT_NEAR(blob.area_px, M_PI * 22 * 22, 1.5 * ring(22));
}

/// Two objects with a narrow gap in the shadow between them stay separate. The gap's pixels are mixed with
/// the hue of both.
TEST_F(ShadowFilterTest, KeepsNarrowGapInShadowOpen) {
  shadow(480, 330, [](double d) { return d < 50 ? 0.7 : 1.0; });
  testing::drawDisc<cv::Vec3b>(image_, 480, 308, 19, {30, 30, 150});
  testing::drawDisc<cv::Vec3b>(image_, 480, 350, 19, {30, 30, 150});
  EXPECT_EQ(blobs().size(), 2U);
}

TEST_F(ShadowFilterTest, RemovesSoftShadowsAndPatchesOfLight) {
  shadow(480, 330, [](double d) { return 1.0 - 0.30 * std::exp(-d * d / (2.0 * 14 * 14)); });
  shadow(160, 330, [](double d) { return 1.0 + 0.25 * std::exp(-d * d / (2.0 * 14 * 14)); });
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
  EXPECT_TRUE(segmenter.vague().empty());
}

/// A soft shadow, except for a short sharp part of its outline on the side away from the camera. It is not
/// segmented as an object, but reported.
TEST_F(ShadowFilterTest, ReportsShadowWithPartlySharpOutlineAsVague) {
  for (int y = 0; y < image_.rows; ++y) {
    for (int x = 0; x < image_.cols; ++x) {
      const double d = std::hypot(x - 480.0, y - 240.0);
      if (x < 502) GreyBox::dim(image_(y, x), 1.0 - 0.45 * std::exp(-d * d / (2.0 * 16 * 16)));
    }
  }
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
  EXPECT_TRUE(segmenter.undecided().empty());
  EXPECT_EQ(segmenter.vague().size(), 1U);
  ASSERT_TRUE(segmenter.segment(testing::unevenFloor(model_, 0.7, 1.5, 11)));
  EXPECT_TRUE(segmenter.vague().empty());
}

TEST_F(ShadowFilterTest, KeepsGreyObjectOfTheFloorsHue) {
  testing::drawDisc<cv::Vec3b>(image_, 480, 330, 16, {82, 88, 95});
  testing::drawDisc<cv::Vec3b>(image_, 160, 330, 16, {190, 205, 220});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 2U);
  for (const Blob& blob : found) EXPECT_NEAR(blob.area_px, M_PI * 256, ring(16));
}

/// A small piece of another object in the same region cannot cast the whole shadow.
TEST_F(ShadowFilterTest, KeepsGreyObjectBesidePieceOfAnother) {
  const cv::Rect top(460, 300, 44, 30), side(460, 330, 44, 26);
  const auto dim = [&](const cv::Rect& face, double share) { image_(face) = image_(face) * share; };
  dim(top, 0.75);
  dim(side, 0.55);
  testing::drawDisc<cv::Vec3b>(image_, 504, 312, 9, {30, 30, 190});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_GT(found[0].area_px, 0.9 * (top.area() + side.area()));
}

/// A sharp-edged tile that is a tenth brighter or darker may be floor or an object of its colour.
TEST_F(ShadowFilterTest, ReportsFaintTileAsUndecided) {
  shadow(480, 330, [](double d) { return d < 18 ? 0.88 : 1.0; });
  shadow(160, 330, [](double d) { return d < 18 ? 1.12 : 1.0; });
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
  ASSERT_EQ(segmenter.undecided().size(), 2U);
  for (const Blob& blob : segmenter.undecided()) EXPECT_NEAR(blob.area_px, M_PI * 18 * 18, ring(18));
  const cv::Mat3b plain = testing::unevenFloor(model_, 0.7, 1.5, 11);
  ASSERT_TRUE(segmenter.segment(plain));
  EXPECT_TRUE(segmenter.undecided().empty());  // nothing remains of the previous frame
}

/// A sharp patch that is a fifth brighter is a grey object, unless the floor has a pattern of nearly this
/// contrast.
TEST_F(ShadowFilterTest, AssignsSlightlyStrongerPatchToThePattern) {
  shadow(440, 340, [](double d) { return d < 14 ? 1.2 : 1.0; });
  EXPECT_EQ(blobs().size(), 1U);
  shadow(190, 330, [](double d) { return d < 12 ? 0.87 : 1.0; });
  shadow(240, 390, [](double d) { return d < 12 ? 1.12 : 1.0; });
  EXPECT_EQ(blobs().size(), 1U);  // two patches may be chance
  shadow(190, 190, [](double d) { return d < 12 ? 1.13 : 1.0; });
  EXPECT_EQ(blobs().size(), 0U);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(segmenter.undecided().size(), 4U);  // and it is reported
  testing::drawDisc<cv::Vec3b>(image_, 440, 200, 16, {30, 30, 190});
  testing::drawDisc<cv::Vec3b>(image_, 480, 260, 16, {22, 20, 20});
  EXPECT_EQ(blobs().size(), 2U);  // objects unlike the floor stay
}

TEST_F(ShadowFilterTest, TreatsSeveralPatchesOfOneContrastAsPattern) {
  shadow(440, 340, [](double d) { return d < 14 ? 1.2 : 1.0; });
  shadow(190, 330, [](double d) { return d < 12 ? 0.79 : 1.0; });
  shadow(240, 390, [](double d) { return d < 12 ? 0.79 : 1.0; });
  EXPECT_EQ(blobs().size(), 3U);  // may be objects
  shadow(190, 190, [](double d) { return d < 12 ? 1.2 : 1.0; });
  testing::drawDisc<cv::Vec3b>(image_, 480, 260, 16, {22, 20, 20});
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(segmenter.undecided().size(), 4U);
  EXPECT_EQ(blobs().size(), 1U);
}

/// Tiles brighter than the rest with a dark joint through them. Neither is an object by itself, and several
/// at once belong to the floor. The joint is darker than tiles, so that no region is faint as a whole.
TEST_F(ShadowFilterTest, TreatsTilesWithDarkJointsAsFloor) {
  const auto tile = [this](double u, double v) {
    shadow(u, v, [](double d) { return d < 13 ? 1.14 : 1.0; });
    for (int y = static_cast<int>(v) - 12; y <= static_cast<int>(v) + 12; ++y)
      for (int x = static_cast<int>(u) - 3; x <= static_cast<int>(u) + 3; ++x)
        for (int c = 0; c < 3; ++c) image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(0.52 * image_(y, x)[c]);
  };
  tile(440, 340);
  tile(190, 330);
  EXPECT_EQ(blobs().size(), 2U);  // two may be objects
  tile(190, 190);
  tile(440, 190);
  EXPECT_EQ(blobs().size(), 0U);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image_));
  EXPECT_EQ(segmenter.undecided().size(), 4U);
  testing::drawDisc<cv::Vec3b>(image_, 480, 260, 16, {22, 20, 20});
  EXPECT_EQ(blobs().size(), 1U);  // a dark object among them stays
}

/// Printed or chequered objects of the floor's hue mix faint patches with shadow, as tiles with joints do.
/// They also have patches clearly brighter than tiles.
TEST_F(ShadowFilterTest, KeepsManyChequeredObjects) {
  const std::vector<cv::Point> places = {{440, 340}, {190, 330}, {190, 190}, {440, 190}};
  for (const cv::Point& at : places)
    for (int y = -16; y < 16; ++y)
      for (int x = -16; x < 16; ++x) {
        const double gain = (x + 16) / 8 % 2 != (y + 16) / 8 % 2 ? 0.8 : (x + 16) / 8 % 2 == 0 ? 1.45 : 0.62;
        cv::Vec3b& pixel = image_(at.y + y, at.x + x);
        for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(gain * pixel[c]);
      }
  const auto found = blobs();
  ASSERT_EQ(found.size(), places.size());
  for (const Blob& blob : found) EXPECT_NEAR(blob.area_px, 32 * 32, 1.5 * 4 * 32);
}

/// An object is chequered in the floor's hue and another hue. Its patches of the floor's hue are no shadow.
TEST_F(ShadowFilterTest, KeepsDarkPatchesOfAPatternedObject) {
  for (int y = -18; y < 18; ++y)
    for (int x = -18; x < 18; ++x) {
      cv::Vec3b& pixel = image_(330 + y, 480 + x);
      if ((x + 18) / 6 % 2 == (y + 18) / 6 % 2)
        pixel = {60, 110, 190};
      else
        for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(0.6 * pixel[c]);
    }
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_GT(found[0].area_px, 0.9 * 36 * 36);
}

/// A soft shadow around a deeper shadow has two kinds of brightness. Both are floor.
TEST_F(ShadowFilterTest, RemovesSoftShadowAroundDeepShadow) {
  shadow(480, 330, [](double d) {
    const auto ramp = [d](double begin, double end) {
      return std::clamp((d - begin) / (end - begin), 0.0, 1.0);
    };
    return 0.5 + 0.28 * ramp(12, 21) + 0.22 * ramp(24, 42);
  });
  EXPECT_TRUE(blobs().empty());
}

TEST_F(ShadowFilterTest, RemovesTileThatTouchesAnObject) {
  shadow(505, 330, [](double d) { return d < 16 ? 1.13 : 1.0; });
  shadow(160, 305, [](double d) { return d < 16 ? 0.87 : 1.0; });
  testing::drawDisc<cv::Vec3b>(image_, 480, 330, 16, {30, 30, 190});
  testing::drawDisc<cv::Vec3b>(image_, 160, 330, 16, {22, 20, 20});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 2U);
  for (const Blob& blob : found) EXPECT_NEAR(blob.area_px, M_PI * 256, ring(16));
}

}  // namespace
}  // namespace omnifleet::ground
