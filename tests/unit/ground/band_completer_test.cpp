#include "ground/band_completer.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

const cv::Size kImage(640, 480);

/// Bands of an object as the segmentation finds them, and the completion around them.
class BandCompleterTest : public ::testing::Test {
 protected:
  BandCompleterTest() : raw_(kImage, std::uint8_t{0}), appearances_(kImage, kFloorAppearance) {}

  void paint(const cv::Rect& rect, Appearance appearance) {
    raw_(rect) = appearance == kFloorAppearance ? 0 : 1;
    appearances_(rect) = appearance;
  }
  /// Mask of the pixels found around the objects painted so far.
  cv::Mat1b found() {
    std::vector<cv::Point> points;
    cv::findNonZero(raw_, points);
    Blob region;
    region.rect = cv::boundingRect(points);
    region.area_px = static_cast<int>(points.size());
    BitMask cleaned(kImage);
    for (const cv::Point& p : points) cleaned.set(p.y, p.x, p.x + 1);
    cv::Mat1b mask(kImage, std::uint8_t{0});
    for (const ground::Run& run : completer_.find(region, {cleaned, cleaned, appearances_}))
      mask.row(run.row).colRange(run.begin, run.end) = 1;
    return mask;
  }

  BandCompleter completer_{kImage};
  cv::Mat1b raw_, appearances_;
};

TEST_F(BandCompleterTest, FillsGapsBetweenBands) {
  const cv::Rect object(300, 200, 30, 28);
  for (const Appearance between : {kFloorAppearance, greyAppearance(0.7f), greyAppearance(1.05f)}) {
    paint(object, between);
    for (int y = 0; y < object.height; y += 8)
      paint({object.x, object.y + y, object.width, 4}, kColourAppearance);
    const cv::Mat1b mask = found();
    EXPECT_EQ(cv::countNonZero(mask(object)), object.area());
    EXPECT_EQ(cv::countNonZero(mask), object.area());
  }
}

TEST_F(BandCompleterTest, FindsVerticalBands) {
  const cv::Rect object(300, 200, 28, 30);
  for (int x = 0; x < object.width; x += 8)
    paint({object.x + x, object.y, 4, object.height}, greyAppearance(0.1f));
  EXPECT_EQ(cv::countNonZero(found()), object.area());
}

TEST_F(BandCompleterTest, RestoresPartlyLostLastBand) {
  const cv::Rect object(300, 200, 30, 28);
  for (int y = 0; y < object.height; y += 8)
    paint({object.x, object.y + y, object.width, 4}, kColourAppearance);
  paint({object.x, object.y + 8, 12, 4}, kFloorAppearance);  // leaves two bands in a row in these columns
  EXPECT_EQ(cv::countNonZero(found()), object.area());
}

TEST_F(BandCompleterTest, RejectsTwoObjectsWithShadowBetween) {
  paint({300, 200, 30, 8}, kColourAppearance);
  paint({300, 208, 30, 6}, greyAppearance(0.6f));
  paint({300, 214, 30, 8}, kColourAppearance);
  EXPECT_EQ(cv::countNonZero(found()), 0);
}

TEST_F(BandCompleterTest, RejectsWideOrUnequalGaps) {
  for (const int y : {0, 20, 40, 60}) paint({100, 200 + y, 30, 6}, kColourAppearance);
  EXPECT_EQ(cv::countNonZero(found()), 0);
  for (const int y : {0, 8, 20}) paint({300, 100 + y, 30, 6}, kColourAppearance);  // gaps of 2 and 6 pixels
  for (const int y : {0, 8, 23}) paint({400, 100 + y, 30, 6}, kColourAppearance);  // gaps of 2 and 9 pixels
  const cv::Mat1b mask = found();
  EXPECT_GT(cv::countNonZero(mask(cv::Rect(300, 100, 30, 26))), 0);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(400, 100, 30, 29))), 0);
}

TEST_F(BandCompleterTest, RejectsFewMatchingLines) {
  for (int y = 0; y < 32; y += 8) paint({300, 200 + y, 5, 4}, kColourAppearance);
  EXPECT_EQ(cv::countNonZero(found()), 0);
}

TEST_F(BandCompleterTest, RejectsGridLines) {
  for (int k = 0; k < 6; ++k) {
    paint({300, 200 + 10 * k, 60, 2}, kColourAppearance);
    paint({300 + 10 * k, 200, 2, 52}, kColourAppearance);
  }
  EXPECT_EQ(cv::countNonZero(found()), 0);
}

/// Boxes with bands of any width are segmented as a whole. Every other band has the floor's own colour.
TEST(BandedObjects, AreSegmentedAsAWhole) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  const cv::Size size(model.image_width_px, model.image_height_px);
  double sum = 0.0;
  int count = 0;
  for (int band = 3; band <= size.width / 64; ++band) {
    for (int above = 0; above < FloorView::kCell; ++above) {
      GroundSegmenter segmenter(camera, view, SegmenterOptions{});
      const cv::Rect box(size.width / 2 - 4 * band, size.height / 8 + above, 9 * band, 7 * band);
      std::mt19937 random(3);
      std::normal_distribution<float> noise(0.0f, 1.5f);
      for (int k = 0; k < 4; ++k) {
        cv::Mat3b image(size, cv::Vec3b(150, 170, 180));
        for (int y = 0; y < box.height; y += 2 * band)
          image(cv::Rect(box.x, box.y + y, box.width, band)).setTo(cv::Scalar(40, 40, 170));
        for (cv::Vec3b& pixel : image)
          for (int c = 0; c < 3; ++c)
            pixel[c] = cv::saturate_cast<std::uint8_t>(static_cast<float>(pixel[c]) + noise(random));
        ASSERT_TRUE(segmenter.segment(image));
      }
      const int within = cv::countNonZero(segmenter.objects()(box)),
                all = cv::countNonZero(segmenter.objects());
      const double share = static_cast<double>(within) / box.area();
      // Pairs of bands merge if their edges coincide with cell borders.
      EXPECT_GT(share, 0.75) << band << " px wide, from row " << box.y;
      EXPECT_LT(all - within, 0.02 * box.area()) << band << " px wide, from row " << box.y;
      sum += share;
      ++count;
    }
  }
  EXPECT_GT(sum / count, 0.95);
}

}  // namespace
}  // namespace omnifleet::ground
