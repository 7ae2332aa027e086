#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/ground_segmenter.h"
#include "ground/labelling.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// Shares of the floor's colour per channel.
using Paint = cv::Vec3d;

/// A box on a floor, drawn face by face through the lens. Each face consists of the floor's own pixels in
/// other light and with a slightly different hue, so that its noise is the floor's.
class SideCompleterTest : public ::testing::Test {
 protected:
  SideCompleterTest()
      : model_(testing::fisheye()),
        camera_(model_),
        view_(camera_, ViewOptions{}),
        image_(testing::unevenFloor(model_, 0.8, 2.0, 21)),
        truth_(image_.size(), std::uint8_t{0}) {}

  /// Mask of a polygon in space. The lens bends its edges.
  cv::Mat1b maskOf(const std::vector<Eigen::Vector3d>& corners) const {
    constexpr int kSteps = 16;
    std::vector<cv::Point> outline;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      for (int k = 0; k < kSteps; ++k) {
        const Eigen::Vector3d& next = corners[(i + 1) % corners.size()];
        const auto pixel = camera_.pixelFromPoint(corners[i] + (next - corners[i]) * k / kSteps);
        EXPECT_TRUE(pixel);
        if (pixel) outline.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
      }
    }
    cv::Mat1b mask(image_.size(), std::uint8_t{0});
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(255));
    return mask;
  }

  void paint(const cv::Mat1b& mask, const Paint& shares) {
    for (int y = 0; y < image_.rows; ++y)
      for (int x = 0; x < image_.cols; ++x)
        for (int c = 0; c < 3 && mask(y, x) != 0; ++c)
          image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * shares[c]);
    truth_ |= mask;
  }

  /// Draws a box ahead of the robot, 18 cm wide, with its front face across.
  void drawBox(const Paint& front, const Paint& top) {
    const double near = 0.80, far = 0.98, half = 0.09, h = height_m_;
    paint(maskOf({{near, -half, h}, {near, half, h}, {far, half, h}, {far, -half, h}}), top);
    cv::Mat1b side = maskOf({{near, -half, 0}, {near, half, 0}, {near, half, h}, {near, -half, h}});
    side &= ~truth_;
    paint(side, front);
  }

  /// Draws a shadow on the floor around the box of drawBox(). It fades over 8 cm and has texture.
  void drawFootShadow(double deep) {
    std::mt19937 random(7);
    std::normal_distribution<double> texture(0.0, 0.05);
    for (int y = 0; y < image_.rows; ++y) {
      for (int x = 0; x < image_.cols; ++x) {
        const auto floor = camera_.floorFromPixel({x, y});
        if (!floor || floor->norm() > 1.6) continue;
        const double ahead = std::max({0.80 - floor->x(), floor->x() - 0.98, 0.0}),
                     beside = std::max(std::abs(floor->y()) - 0.09, 0.0);
        const double shadow = deep * std::exp(-std::hypot(ahead, beside) / 0.08),
                     light = 1.0 + texture(random);
        for (int c = 0; c < 3 && shadow > 0.01; ++c)
          image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * (1.0 - shadow) * light);
      }
    }
  }

  std::vector<Blob> blobs() {
    GroundSegmenter segmenter(camera_, view_, {});
    EXPECT_TRUE(segmenter.segment(image_));
    objects_ = segmenter.objects().clone();
    Labeller labeller;
    return labeller.label(segmenter.bits(), segmenter.area(), 20);
  }

  /// Expects one region that is the whole box. The lens noise may cost two pixels of the outline.
  void expectTheBox() {
    EXPECT_EQ(blobs().size(), 1U);
    const cv::Mat1b disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5});
    cv::Mat1b inner, outer;
    cv::erode(truth_, inner, disc);
    cv::dilate(truth_, outer, disc);
    EXPECT_EQ(cv::countNonZero(objects_ & ~outer), 0);
    EXPECT_LE(cv::countNonZero(inner & ~objects_), 0.02 * cv::countNonZero(inner));
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
  cv::Mat3b image_;
  cv::Mat1b truth_, objects_;
  double height_m_ = 0.2;
};

TEST_F(SideCompleterTest, AddsTopByItsHue) {
  drawBox({0.68, 0.65, 0.62}, {1.04, 1.0, 0.96});
  expectTheBox();
}

TEST_F(SideCompleterTest, AddsTopByItsBrightness) {
  drawBox({0.65, 0.65, 0.65}, {1.08, 1.08, 1.08});
  expectTheBox();
}

TEST_F(SideCompleterTest, JoinsBrightTopAndShadowedSide) {
  drawBox({0.74, 0.74, 0.74}, {1.3, 1.3, 1.3});
  expectTheBox();
}

TEST_F(SideCompleterTest, AddsSlightlyDarkerTop) {
  drawBox({0.68, 0.65, 0.62}, {0.98, 0.94, 0.90});
  expectTheBox();
}

TEST_F(SideCompleterTest, AddsNothingIfFloorLiesBehindTheSide) {
  drawBox({0.65, 0.65, 0.65}, {1.0, 1.0, 1.0});
  const cv::Mat1b side =
      maskOf({{0.8, -0.09, 0}, {0.8, 0.09, 0}, {0.8, 0.09, height_m_}, {0.8, -0.09, height_m_}});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, cv::countNonZero(side),
              0.12 * cv::countNonZero(side));  // one pixel all around
}

TEST_F(SideCompleterTest, RejectsSoftShadowOfBrightObjectAsSide) {
  // The shadow is larger than the object and fades over a distance like its depth.
  const double r = 10;
  for (int y = 0; y < image_.rows; ++y) {
    for (int x = 0; x < image_.cols; ++x) {
      const double share = 1.0 - 0.5 * std::exp(-0.5 * std::pow(std::hypot(x - 466.0, y - 330.0) / 11.0, 2));
      for (int c = 0; c < 3; ++c) image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * share);
    }
  }
  testing::drawDisc<cv::Vec3b>(image_, 482, 330, r, {225, 238, 252});
  const auto found = blobs();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].area_px, M_PI * r * r, 1.5 * 2.0 * M_PI * r);
}

TEST_F(SideCompleterTest, ExcludesShadowBeforeDarkObject) {
  drawBox({0.39, 0.39, 0.39}, {0.44, 0.44, 0.44});
  const cv::Mat1b box = truth_.clone();
  for (int i = 0; i < 5; ++i) {
    const double end = 0.80 - 0.012 * i, begin = end - 0.012, share = 0.68 + 0.04 * i;
    paint(maskOf({{begin, -0.1, 0}, {begin, 0.1, 0}, {end, 0.1, 0}, {end, -0.1, 0}}) & ~truth_,
          {share, share, share});
  }
  truth_ = box;
  expectTheBox();
}

TEST_F(SideCompleterTest, AddsBrightTopOfDarkObject) {
  drawBox({0.38, 0.38, 0.38}, {0.68, 0.68, 0.68});
  expectTheBox();
}

/// The floor darkens towards the foot, ragged by its texture. This fringe does not belong to the object, and
/// its outline must not decide between side and shadow.
TEST_F(SideCompleterTest, EndsSideAtTheShadowAtItsFoot) {
  for (const double deep : {0.15, 0.28}) {
    image_ = testing::unevenFloor(model_, 0.8, 2.0, 21);
    truth_.setTo(0);
    drawFootShadow(deep);
    drawBox({0.56, 0.56, 0.56}, {1.08, 1.08, 1.08});
    expectTheBox();
  }
}

/// Most of the outline is the foot, which fades. The outline behind and beside it decides.
TEST_F(SideCompleterTest, FindsLowSideWithShadowAtItsFoot) {
  height_m_ = 0.08;
  drawFootShadow(0.28);
  drawBox({0.72, 0.72, 0.72}, {1.08, 1.08, 1.08});
  EXPECT_EQ(blobs().size(), 1U);
}

/// The side is lit from the right. There it is so little darker than the floor that only the rest is
/// segmented.
TEST_F(SideCompleterTest, AddsFaintEndOfSideWithoutFootShadow) {
  drawBox({0.65, 0.65, 0.65}, {1.1, 1.1, 1.1});
  for (int k = 0; k < 6; ++k) {
    const double a = 0.09 - 0.03 * k, b = a - 0.03, light = 1.0 + 0.06 * k;
    const cv::Mat1b box = truth_.clone();
    paint(maskOf({{0.8, a, 0}, {0.8, b, 0}, {0.8, b, height_m_}, {0.8, a, height_m_}}),
          {light, light, light});
    truth_ = box;
  }
  expectTheBox();
}

/// Tests of the completer alone, on a floor of one known colour.
class CompletionTest : public SideCompleterTest {
 protected:
  static constexpr double kFloor = 150.0;
  CompletionTest()
      : floor_(view_.cells(), cv::Vec3f::all(kFloor)), appearances_(image_.size(), kFloorAppearance) {
    image_.setTo(cv::Scalar::all(kFloor));
  }

  /// Draws a dark strip of 10×30 pixels to the right of the camera. A margin of `spread_px` around it has
  /// `brighter` times the floor's brightness.
  Blob drawStrip(int spread_px, double brighter) {
    const cv::Rect strip(460, 320, 10, 30);
    const cv::Rect area(strip.x, strip.y - spread_px, strip.width + spread_px, strip.height + 2 * spread_px);
    image_(area).setTo(cv::Scalar::all(kFloor * brighter));
    image_(strip).setTo(cv::Scalar::all(kFloor * 0.65));
    appearances_(strip).setTo(greyAppearance(0.65f));
    Blob blob;
    blob.rect = strip;
    blob.area_px = strip.area();
    for (int y = strip.y; y < strip.y + strip.height; ++y)
      blob.runs.push_back({y, strip.x, strip.x + strip.width});
    return blob;
  }

  int complete(SideCompleter& completer, const Blob& side, float noise) {
    const ShadowFilter::Frame shadow{image_, floor_, 0.02f, noise, completer.foot(), view_.mask()};
    BitMask found(image_.size());
    for (const ground::Run& run : side.runs) found.set(run.row, run.begin, run.end);
    int area = 0;
    for (const ground::Run& run : completer.complete({shadow, view_.mask(), appearances_, found}, side))
      area += run.end - run.begin;
    return area;
  }

  cv::Mat3f floor_;
  cv::Mat1b appearances_;
};

TEST_F(CompletionTest, AddsNothingToIsolatedSide) {
  SideCompleter completer(camera_, image_.size());
  EXPECT_EQ(complete(completer, drawStrip(0, 1.0), 1.0f), 0);
}

TEST_F(CompletionTest, AddsBoundedSurface) {
  SideCompleter completer(camera_, image_.size());
  const Blob side = drawStrip(8, 1.08);
  EXPECT_NEAR(complete(completer, side, 1.0f), 18 * 46, 100);  // the 5×5 means cut its corners
}

TEST_F(CompletionTest, RejectsSurfaceThatFillsTheSearchArea) {
  SideCompleter completer(camera_, image_.size());
  const Blob side = drawStrip(90, 1.08);
  EXPECT_EQ(complete(completer, side, 1.0f), 0);
}

TEST_F(CompletionTest, CarriesNothingOverToTheNextSide) {
  SideCompleter used(camera_, image_.size()), fresh(camera_, image_.size());
  for (const int spread_px : {90, 24, 60}) complete(used, drawStrip(spread_px, 1.08), 1.0f);
  image_.setTo(cv::Scalar::all(kFloor));
  const Blob side = drawStrip(8, 1.08);
  EXPECT_EQ(complete(used, side, 1.0f), complete(fresh, side, 1.0f));
}

TEST_F(CompletionTest, IgnoresHueWithinTheNoise) {
  SideCompleter completer(camera_, image_.size());
  const Blob side = drawStrip(8, 1.0);
  for (int y = 300; y < 380; ++y) {
    for (int x = 440; x < 500; ++x) {
      image_(y, x)[0] = cv::saturate_cast<std::uint8_t>(image_(y, x)[0] * 0.984);
      image_(y, x)[2] = cv::saturate_cast<std::uint8_t>(image_(y, x)[2] * 1.016);
    }
  }
  EXPECT_GE(complete(completer, side, 1.0f), 1.5 * side.area_px);
  EXPECT_EQ(complete(completer, side, 30.0f), 0);
}

}  // namespace
}  // namespace omnifleet::ground
