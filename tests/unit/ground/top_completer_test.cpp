#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/ground_segmenter.h"
#include "ground/labelling.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// Boxes of exactly the floor's hue, drawn through the lens. Tops are in more light. Sides have the floor's
/// brightness on average, with small local variations.
class TopCompleterTest : public ::testing::Test {
 protected:
  TopCompleterTest()
      : model_(testing::fisheye()),
        camera_(model_),
        view_(camera_, ViewOptions{}),
        segmenter_(camera_, view_, {}),
        image_(testing::unevenFloor(model_, 0.8, 2.0, 21)) {}

  cv::Mat1b maskOf(const std::vector<Eigen::Vector3d>& corners) const {
    constexpr int kSteps = 16;  // the lens bends edges
    std::vector<cv::Point> outline;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      for (int k = 0; k < kSteps; ++k) {
        const auto pixel = camera_.pixelFromPoint(
            corners[i] + (corners[(i + 1) % corners.size()] - corners[i]) * k / kSteps);
        EXPECT_TRUE(pixel);
        if (pixel) outline.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
      }
    }
    cv::Mat1b mask(image_.size(), std::uint8_t{0});
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(255));
    return mask;
  }

  /// Brightness factors per pixel: 1 on average, with small local variations.
  cv::Mat1f mottle(double sigma, int seed) const {
    cv::Mat1f gain(image_.size());
    cv::RNG random(static_cast<std::uint64_t>(seed));
    random.fill(gain, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(gain, gain, {0, 0}, 1.5);
    cv::Scalar mean, deviation;
    cv::meanStdDev(gain, mean, deviation);
    return 1.0 + gain * (sigma / deviation[0]);
  }

  void light(const cv::Mat1b& where, const cv::Mat1f& gain) {
    for (int y = 0; y < image_.rows; ++y)
      for (int x = 0; x < image_.cols; ++x)
        for (int c = 0; c < 3 && where(y, x) != 0; ++c)
          image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * gain(y, x));
  }

  /// Draws a box 28 cm wide and 20 cm high, with its front face across at distance `near`.
  /// @return its silhouette
  cv::Mat1b drawBox(double near, double top_gain, double mottled, double deep = 0.22) {
    const double far = near + deep, half = 0.14, h = 0.2;
    const cv::Mat1b top = maskOf({{near, -half, h}, {near, half, h}, {far, half, h}, {far, -half, h}});
    const cv::Mat1b side = maskOf({{near, -half, 0}, {near, half, 0}, {near, half, h}, {near, -half, h}});
    cv::Mat1f gain = mottle(mottled, 5);
    gain.setTo(top_gain, top);
    light(top | side, gain);
    return top | side;
  }

  /// Draws a bright patch on the floor behind the robot.
  /// @return its mask
  cv::Mat1b drawPatch() {
    const cv::Mat1b patch = maskOf({{-0.9, -0.2, 0}, {-0.9, 0.2, 0}, {-1.3, 0.2, 0}, {-1.3, -0.2, 0}});
    light(patch, cv::Mat1f(image_.size(), 1.29f));
    return patch;
  }

  static double overlap(const cv::Mat1b& a, const cv::Mat1b& b) {
    return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
  GroundSegmenter segmenter_;
  cv::Mat3b image_;
};

TEST_F(TopCompleterTest, AddsSideAsBrightAsTheFloor) {
  const cv::Mat1b box = drawBox(0.8, 1.29, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_));
  // Tolerance: two pixels of the outline. The top alone is half of the silhouette.
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
  Labeller labeller;
  const auto& regions = labeller.label(segmenter_.bits(), segmenter_.area(), 20);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_TRUE(segmenter_.isRough(regions[0]));
}

TEST_F(TopCompleterTest, DecidesUndecidedTopByItsSides) {
  const cv::Mat1b box = drawBox(0.8, 1.16, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
  EXPECT_TRUE(segmenter_.undecided().empty());
}

TEST_F(TopCompleterTest, ExtendsSideToTheRobotThatHidesItsFoot) {
  const cv::Mat1b box = drawBox(0.3, 1.29, 0.09) & view_.mask();
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
}

/// Both faces are brighter than the floor, one of them only slightly. It is no patch of light that fades.
TEST_F(TopCompleterTest, FindsWhiteObjectWithLessLitSides) {
  const cv::Mat1b side = maskOf({{0.8, -0.14, 0}, {0.8, 0.14, 0}, {0.8, 0.14, 0.2}, {0.8, -0.14, 0.2}});
  image_ = 0.6 * image_;
  const cv::Mat1b box = drawBox(0.8, 2.3, 0.0);
  light(side, cv::Mat1f(image_.size(), 1.25f));
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
}

/// The sides differ from the floor by a tenth, too little for an intensity edge, and most of the visible area
/// is side. The sharp outline along the top decides.
TEST_F(TopCompleterTest, FindsWhiteObjectWithSidesLikeTheFloor) {
  const cv::Mat1b side = maskOf({{0.8, -0.14, 0}, {0.8, 0.14, 0}, {0.8, 0.14, 0.2}, {0.8, -0.14, 0.2}});
  image_ = 0.7 * image_;
  const cv::Mat1b box = drawBox(0.8, 1.6, 0.0);
  light(side, cv::Mat1f(image_.size(), 1.1f));
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
  EXPECT_TRUE(segmenter_.vague().empty());
}

/// The side has the floor's colour and mean brightness, but not its texture.
TEST_F(TopCompleterTest, DistinguishesSideByMissingFloorTexture) {
  const cv::Mat3b smooth = image_.clone();
  light(cv::Mat1b(image_.size(), std::uint8_t{255}), mottle(0.05, 8));
  const cv::Mat1b side = maskOf({{0.8, -0.14, 0}, {0.8, 0.14, 0}, {0.8, 0.14, 0.2}, {0.8, -0.14, 0.2}});
  const cv::Mat1b box = drawBox(0.8, 1.4, 0.0);
  smooth.copyTo(image_, side);
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
}

/// A bright mark, and before it worn floor that is slightly smoother. The worn floor is no side.
TEST_F(TopCompleterTest, RejectsWornFloorBeforeBrightMark) {
  const cv::Mat1b mark = maskOf({{0.85, -0.2, 0}, {0.85, 0.2, 0}, {1.15, 0.2, 0}, {1.15, -0.2, 0}}),
                  worn = maskOf({{0.6, -0.2, 0}, {0.6, 0.2, 0}, {0.85, 0.2, 0}, {0.85, -0.2, 0}});
  cv::Mat1f gain = mottle(0.05, 8);
  mottle(0.03, 9).copyTo(gain, worn);
  gain.setTo(1.4f, mark);
  light(cv::Mat1b(image_.size(), std::uint8_t{255}), gain);
  ASSERT_TRUE(segmenter_.segment(image_));
  cv::Mat1b near;
  cv::dilate(mark, near, cv::Mat1b::ones(5, 5));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() & ~near), 0);
  EXPECT_GT(cv::countNonZero(segmenter_.objects() & mark), 0);
}

/// A mat lies before the side and varies half as much in brightness.
TEST_F(TopCompleterTest, FindsNoFootIfNoFloorFollows) {
  const cv::Mat1b mat = maskOf({{0.3, -0.2, 0}, {0.3, 0.2, 0}, {0.82, 0.2, 0}, {0.82, -0.2, 0}});
  light(mat, mottle(0.05, 6));
  drawBox(0.8, 1.29, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_));
  Labeller labeller;
  for (const Blob& region : labeller.label(segmenter_.bits(), segmenter_.area(), 20))
    EXPECT_FALSE(segmenter_.isRough(region));
}

TEST_F(TopCompleterTest, AddsNoSideToSharpPatchOfLight) {
  const cv::Mat1b patch = drawPatch();
  ASSERT_TRUE(segmenter_.segment(image_));
  cv::Mat1b near;
  cv::dilate(patch, near, cv::Mat1b::ones(5, 5));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() & ~near), 0);
  EXPECT_GT(cv::countNonZero(segmenter_.objects() & patch), 0);
  Labeller labeller;
  for (const Blob& region : labeller.label(segmenter_.bits(), segmenter_.area(), 20))
    EXPECT_FALSE(segmenter_.isRough(region));
}

TEST_F(TopCompleterTest, ReportsPatchBesideCompletedTopAsUndecided) {
  const cv::Mat1b patch = drawPatch();
  drawBox(0.8, 1.29, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() & patch), 0);
  EXPECT_EQ(segmenter_.undecided().size(), 1U);
}

/// Such objects were visible in recent frames. An object that also shows its side is complete.
TEST_F(TopCompleterTest, ReportsBrightRegionAsUndecidedForAWhile) {
  const cv::Mat3b floor = image_.clone();
  drawBox(0.8, 1.29, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_));
  floor.copyTo(image_);
  const cv::Mat1b patch = drawPatch();
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() & patch), 0);
  EXPECT_EQ(segmenter_.undecided().size(), 1U);
  const cv::Mat1b side = maskOf({{0.8, -0.14, 0}, {0.8, 0.14, 0}, {0.8, 0.14, 0.2}, {0.8, -0.14, 0.2}});
  const cv::Mat1b box = drawBox(0.8, 1.29, 0.0);
  light(side, cv::Mat1f(image_.size(), 0.3f));
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() & patch), 0);
  EXPECT_GT(overlap(segmenter_.objects() == 255, box), 0.85);
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_GT(cv::countNonZero(segmenter_.objects() & patch), 0);
}

TEST_F(TopCompleterTest, ReportsTopTooFarAwayAsUndecided) {
  drawBox(1.4, 1.29, 0.09, 0.5);  // there a pixel covers 3 cm of the floor
  ASSERT_TRUE(segmenter_.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects()), 0);
  EXPECT_FALSE(segmenter_.undecided().empty());
}

TEST_F(TopCompleterTest, CarriesNothingOverFromThePreviousFrame) {
  GroundSegmenter fresh(camera_, view_, {});
  const cv::Mat3b floor = image_.clone();
  drawBox(0.9, 1.4, 0.12);
  ASSERT_TRUE(segmenter_.segment(image_));
  floor.copyTo(image_);
  drawBox(0.8, 1.29, 0.09);
  ASSERT_TRUE(segmenter_.segment(image_) && fresh.segment(image_));
  EXPECT_EQ(cv::countNonZero(segmenter_.objects() != fresh.objects()), 0);
}

}  // namespace
}  // namespace omnifleet::ground
