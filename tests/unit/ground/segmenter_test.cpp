#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/ground_segmenter.h"
#include "ground/labelling.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

struct Disc {
  double u, v, r;
  cv::Vec3b colour;
};

const std::vector<Disc> kDiscs = {{160, 150, 20, {40, 40, 42}},
                                  {480, 330, 16, {30, 30, 200}},
                                  {330, 60, 12, {200, 90, 20}},
                                  {200, 400, 25, {60, 180, 60}}};

class SegmenterTest : public ::testing::Test {
 protected:
  SegmenterTest() : model_(testing::fisheye()), camera_(model_), view_(camera_, ViewOptions{}) {}

  void addDiscs(cv::Mat3b& image) {
    truth_ = cv::Mat1b(image.size(), std::uint8_t{0});
    for (const auto& d : kDiscs) {
      testing::drawDisc<cv::Vec3b>(image, d.u, d.v, d.r, d.colour);
      testing::drawDisc<std::uint8_t>(truth_, d.u, d.v, d.r, 255);
    }
    truth_ = truth_ > 127;
  }

  /// Expects every disc to be found within two pixels all around, and nothing else.
  void expectDiscs(const GroundSegmenter& segmenter) {
    const auto disc = [](int r) {
      return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * r + 1, 2 * r + 1});
    };
    cv::Mat1b inner, outer;
    cv::erode(truth_, inner, disc(2));
    cv::dilate(truth_, outer, disc(2));
    EXPECT_EQ(cv::countNonZero(inner & ~segmenter.objects()), 0);
    EXPECT_EQ(cv::countNonZero(segmenter.objects() & ~outer), 0);
    Labeller labeller;
    EXPECT_EQ(labeller.label(segmenter.bits(), segmenter.area(), 20).size(), kDiscs.size());
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
  cv::Mat1b truth_;
};

/// Large images are grown in blocks of several cells. A seed region without a whole block gives no floor.
TEST_F(SegmenterTest, ReportsNoFloorForSeedsThinnerThanABlock) {
  lens::CameraModel large = model_;
  large.image_width_px *= 2;
  large.image_height_px *= 2;
  large.focal_px *= 2.0;
  large.principal_point_px = 2.0 * large.principal_point_px + Eigen::Vector2d(0.5, 0.5);
  ViewOptions options;
  options.seed_rectangle_px = {604, 60, 4, 4};
  const lens::Camera camera(large);
  const FloorView view(camera, options);
  ASSERT_EQ(view.seedCells().size(), 1U);
  GroundSegmenter segmenter(camera, view, {});
  EXPECT_FALSE(segmenter.segment(cv::Mat3b(view.imageSize(), cv::Vec3b(150, 150, 150))));
}

TEST_F(SegmenterTest, FindsObjectsAsDarkAsTheFarFloor) {
  // The floor darkens to 35 % towards the rim. There it is no brighter than the dark disc near the robot.
  cv::Mat3b image = testing::unevenFloor(model_, 0.35, 2.0, 1);
  addDiscs(image);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image));
  expectDiscs(segmenter);
}

TEST_F(SegmenterTest, NeedsEvenLightForSingleHistogram) {
  SegmenterOptions literal;
  literal.method = "histogram";
  GroundSegmenter segmenter(camera_, view_, literal);
  cv::Mat3b even = testing::unevenFloor(model_, 1.0, 2.0, 2);
  addDiscs(even);
  ASSERT_TRUE(segmenter.segment(even));
  expectDiscs(segmenter);
  cv::Mat3b uneven = testing::unevenFloor(model_, 0.35, 2.0, 1);
  ASSERT_TRUE(segmenter.segment(uneven));
  EXPECT_GT(cv::countNonZero(segmenter.objects()), 10000);  // the dark rim is segmented as objects
}

TEST_F(SegmenterTest, SegmentsBareNoisyFloorAsFloor) {
  for (const double noise : {0.0, 2.0, 6.0}) {
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(testing::unevenFloor(model_, 0.5, noise, 3)));
    EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0) << noise;
    ASSERT_TRUE(segmenter.segment(testing::dimFloor(model_, 24.0, 0.6 * noise, 3)));
    EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0) << noise;
  }
}

/// Simulates a compressing camera: colours at half the resolution, quantised in blocks of 16 × 16 pixels.
TEST_F(SegmenterTest, TreatsJpegColourRingingAsFloor) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    cv::Mat3b image = testing::unevenFloor(model_, 0.8, 1.5, seed);
    for (auto& pixel : image) pixel = 0.55 * pixel;
    truth_ = cv::Mat1b(image.size(), std::uint8_t{0});
    const double shift = 3.1 * seed;
    for (const auto& [u, v, colour] :
         {std::tuple(160.0, 150.0, cv::Vec3b(110, 20, 10)), std::tuple(470.0, 330.0, cv::Vec3b(20, 20, 130)),
          std::tuple(200.0, 390.0, cv::Vec3b(20, 100, 20)),
          std::tuple(450.0, 110.0, cv::Vec3b(20, 120, 140))}) {
      testing::drawDisc<cv::Vec3b>(image, u + shift, v, 21.0, colour);
      testing::drawDisc<std::uint8_t>(truth_, u + shift, v, 21.0, 255);
    }
    std::vector<std::uint8_t> file;
    ASSERT_TRUE(cv::imencode(".jpg", image, file, {cv::IMWRITE_JPEG_QUALITY, 70}));
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(cv::imdecode(file, cv::IMREAD_COLOR)));
    cv::Mat1b inner, outer;  // chroma at half resolution mixes two pixels on each side of the edge
    cv::erode(truth_ > 127, inner, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
    cv::dilate(truth_ > 127, outer, cv::getStructuringElement(cv::MORPH_ELLIPSE, {7, 7}));
    // The few remaining pixels belong to the edge itself. Without the ringing rule there are 900.
    EXPECT_LE(cv::countNonZero(segmenter.objects() & ~outer), 4) << seed;
    EXPECT_EQ(cv::countNonZero(inner & ~segmenter.objects()), 0) << seed;
  }
}

TEST_F(SegmenterTest, GrowsAcrossGridLinesAndTreatsThemAsFloor) {
  cv::Mat3b image = testing::unevenFloor(model_, 0.6, 1.0, 4);
  for (int k = 10; k < 640; k += 36) cv::line(image, {k, 0}, {k, 479}, {70, 75, 80}, 2, cv::LINE_AA);
  for (int k = 10; k < 480; k += 36) cv::line(image, {0, k}, {639, k}, {70, 75, 80}, 2, cv::LINE_AA);
  SegmenterOptions options;
  options.line_width_m = 0.025;  // the anti-aliased lines are up to 4 px wide; one pixel is 4 to 5 mm
  GroundSegmenter segmenter(camera_, view_, options);
  ASSERT_TRUE(segmenter.segment(image));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
  testing::drawDisc<cv::Vec3b>(image, 470, 330, 16, {30, 30, 200});
  ASSERT_TRUE(segmenter.segment(image));
  Labeller labeller;
  const auto& blobs = labeller.label(segmenter.bits(), segmenter.area(), 20);
  ASSERT_EQ(blobs.size(), 1U);
  EXPECT_NEAR(blobs[0].area_px, M_PI * 256,
              200);  // a ring of one pixel is 100 px²; the rest are stubs of the lines
}

/// Paints a patch of floor as the camera sees it.
void paintFloor(cv::Mat3b& image, const lens::Camera& camera, double from_m, double to_m, double bearing_rad,
                double half_wide_m) {
  const Eigen::Rotation2Dd turn(bearing_rad);
  std::vector<cv::Point> outline;
  const auto add = [&](double x_m, double y_m) {
    const Eigen::Vector2d at = camera.foot() + turn * Eigen::Vector2d(x_m, y_m);
    const auto pixel = camera.pixelFromPoint({at.x(), at.y(), 0.0});
    ASSERT_TRUE(pixel);
    outline.emplace_back(cvRound(16.0 * pixel->x()), cvRound(16.0 * pixel->y()));
  };
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) add(from_m + (to_m - from_m) * i / kSteps, -half_wide_m);
  for (int i = 0; i <= kSteps; ++i) add(to_m, half_wide_m * (2.0 * i / kSteps - 1.0));
  for (int i = kSteps; i >= 0; --i) add(from_m + (to_m - from_m) * i / kSteps, half_wide_m);
  cv::fillPoly(image, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(40, 160, 210), cv::LINE_AA, 4);
}

// The silhouette of a box of 0.3 m at two metres is as thin as a near grid line. Tape that leads away from
// the camera is equally thin there, but along its whole length. Tape across is thinner still.
TEST_F(SegmenterTest, FindsFarThinObjectsButNoTape) {
  const auto found = [&](double from_m, double to_m, double bearing_rad, double half_wide_m) {
    cv::Mat3b image = testing::unevenFloor(model_, 0.8, 1.0, 4);
    paintFloor(image, camera_, from_m, to_m, bearing_rad, half_wide_m);
    GroundSegmenter segmenter(camera_, view_, {});
    EXPECT_TRUE(segmenter.segment(image));
    Labeller labeller;
    return labeller.label(segmenter.bits(), segmenter.area(), 20).size();
  };
  for (const double bearing_rad : {-1.3, -0.3, 1.2, 2.6}) {
    EXPECT_EQ(found(2.2, 2.6, bearing_rad, 0.15), 1U) << bearing_rad;
    EXPECT_EQ(found(1.0, 2.7, bearing_rad, 0.018), 0U) << bearing_rad;
    EXPECT_EQ(found(1.8, 1.85, bearing_rad, 0.3), 0U) << bearing_rad;
    EXPECT_EQ(found(1.0, 1.07, bearing_rad, 0.15), 0U) << bearing_rad;
  }
}

// A closed line around the robot is a line on the floor, or the robot's own body if its mask is too small.
// Walls have a height, and floor before them.
TEST_F(SegmenterTest, RejectsClosedLinesAsWalls) {
  const cv::Point foot(cvRound(model_.principal_point_px.x()), cvRound(model_.principal_point_px.y()));
  const int own = cvRound(model_.self_mask_radius_px);
  for (const auto& [radius_px, width_px] : {std::pair{own + 40, 3}, {own + 1, 6}, {own + 1, 30}}) {
    cv::Mat3b image = testing::unevenFloor(model_, 0.7, 1.0, 4);
    cv::circle(image, foot, radius_px, {40, 42, 45}, width_px, cv::LINE_AA);
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(image));
    EXPECT_FALSE(segmenter.hasLowWalls()) << radius_px << " " << width_px;
  }
  cv::Mat3b image = testing::unevenFloor(model_, 0.7, 1.0, 4);
  cv::circle(image, foot, own + 90, {40, 42, 45}, 5, cv::LINE_AA);  // 0.3 m wide on the floor
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image));
  EXPECT_TRUE(segmenter.hasLowWalls());
}

/// In dim light the hue of a grey wall differs from the floor's by less than the noise of a pixel. Its
/// brightness equals the floor's.
class FaintWallTest : public SegmenterTest {
 protected:
  static constexpr double kLevel = 38.0, kNoise = 2.1;
  cv::Mat3b floor() const { return testing::dimFloor(model_, kLevel, 0.0, 1); }
  /// Draws the wall in grey, as bright as the floor at each pixel.
  void drawWall(cv::Mat3b& image, const cv::Mat1b& where) const {
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x) {
        const int sum = image(y, x)[0] + image(y, x)[1] + image(y, x)[2];
        const auto grey = cv::saturate_cast<std::uint8_t>(sum / 3.0);
        if (where(y, x) != 0) image(y, x) = {grey, grey, grey};
      }
  }
  cv::Mat1b ring(int radius_px, int width_px) const {
    cv::Mat1b where(model_.image_height_px, model_.image_width_px, std::uint8_t{0});
    cv::circle(where, {cvRound(model_.principal_point_px.x()), cvRound(model_.principal_point_px.y())},
               radius_px, 255, width_px);
    return where;
  }
};

TEST_F(FaintWallTest, FindsWallAndObjectBeforeIt) {
  for (const int radius_px : {160, 185}) {
    cv::Mat3b image = floor();
    cv::Mat1b wall = ring(radius_px, 28);
    drawWall(image, wall);
    const cv::Point at(cvRound(model_.principal_point_px.x()) + radius_px - 14, 240);
    testing::drawDisc<cv::Vec3b>(image, at.x, at.y, 14, {12, 12, 11});
    cv::circle(wall, at, 16, 0, cv::FILLED);
    GroundSegmenter segmenter(camera_, view_, {});
    for (unsigned seed = 1; seed <= 3; ++seed) {
      ASSERT_TRUE(segmenter.segment(testing::withNoise(image, kNoise, seed)));
      ASSERT_TRUE(segmenter.hasLowWalls()) << radius_px << " " << seed;
      const cv::Mat1b found = segmenter.objects() == LowWalls::kWall, objects = segmenter.objects() == 255;
      EXPECT_GT(cv::countNonZero(found & wall), 0.8 * cv::countNonZero(wall)) << radius_px << " " << seed;
      EXPECT_LT(cv::countNonZero(found & ~ring(radius_px, 38)), 20) << radius_px << " " << seed;
      cv::Mat1b disc(image.size(), std::uint8_t{0});
      cv::circle(disc, at, 12, 255, cv::FILLED);
      EXPECT_GT(cv::countNonZero(objects & disc), 0.95 * cv::countNonZero(disc)) << radius_px << " " << seed;
      cv::circle(disc, at, 18, 255, cv::FILLED);
      EXPECT_LT(cv::countNonZero(objects & ~disc), 60) << radius_px << " " << seed;
    }
  }
}

/// The floor visible beyond the wall, up to the border of the view, is no wall.
TEST_F(FaintWallTest, FindsWallBeforeItsShadowOnTheFloor) {
  cv::Mat3b image = floor();
  const cv::Mat1b wall = ring(160, 28);
  drawWall(image, wall);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (std::hypot(x - model_.principal_point_px.x(), y - model_.principal_point_px.y()) > 174.0)
        image(y, x) *= 0.6;
  GroundSegmenter segmenter(camera_, view_, {});
  for (unsigned seed = 1; seed <= 3; ++seed) {
    ASSERT_TRUE(segmenter.segment(testing::withNoise(image, kNoise, seed)));
    ASSERT_TRUE(segmenter.hasLowWalls()) << seed;
    const cv::Mat1b found = segmenter.objects() == LowWalls::kWall;
    EXPECT_GT(cv::countNonZero(found & wall), 0.8 * cv::countNonZero(wall)) << seed;
    EXPECT_LT(cv::countNonZero(found & ring(70, 138)), 20) << seed << " (before the wall's foot)";
  }
}

TEST_F(FaintWallTest, RejectsLinesAndGridsOfWallColour) {
  cv::Mat3b line = floor(), grid = floor(), nothing = floor();
  drawWall(line, ring(140, 4));
  cv::Mat1b lines(grid.size(), std::uint8_t{0});
  for (int k = 10; k < 640; k += 40) cv::line(lines, {k, 0}, {k, 479}, 255, 5);
  for (int k = 10; k < 480; k += 40) cv::line(lines, {0, k}, {639, k}, 255, 5);
  drawWall(grid, lines);
  for (const cv::Mat3b& image : {line, grid, nothing}) {
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(testing::withNoise(image, kNoise, 4)));
    EXPECT_FALSE(segmenter.hasLowWalls());
    EXPECT_LT(cv::countNonZero(segmenter.objects()), 200) << "only specks may remain";
  }
}

TEST_F(SegmenterTest, TreatsCentimetreGridLinesAsFloorByDefault) {
  cv::Mat3b image = testing::unevenFloor(model_, 0.6, 1.0, 4);
  // Anti-aliased lines are up to 3 px wide, 12 to 15 mm near the robot, and wider where they cross.
  for (int k = 10; k < 640; k += 72) cv::line(image, {k, 0}, {k + 40, 479}, {70, 75, 80}, 1, cv::LINE_AA);
  for (int k = 10; k < 480; k += 72) cv::line(image, {0, k}, {639, k + 40}, {70, 75, 80}, 1, cv::LINE_AA);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
}

TEST_F(SegmenterTest, FindsObjectInTheSeedRing) {
  cv::Mat3b image = testing::unevenFloor(model_, 0.7, 2.0, 5);
  truth_ = cv::Mat1b(image.size(), std::uint8_t{0});
  testing::drawDisc<cv::Vec3b>(image, 450, 240, 34, {20, 190, 210});  // as wide as the ring
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(image));
  Labeller labeller;
  const auto& blobs = labeller.label(segmenter.bits(), segmenter.area(), 20);
  ASSERT_EQ(blobs.size(), 1U);
  EXPECT_NEAR(blobs[0].area_px, M_PI * 34 * 34, 250);
}

TEST_F(SegmenterTest, FindsObjectInTheSeedRingInDimLight) {
  // A green object and the floor differ by a few grey levels in dim light. Blur fills the levels between
  // them.
  cv::Mat3b image = testing::dimFloor(model_, 24.0, 0.0, 8);
  testing::drawDisc<cv::Vec3b>(image, 450, 240, 34, {10, 32, 12});
  const cv::Mat3b noisy = testing::withNoise(testing::blurred(image, 2.0), 2.5, 9);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(noisy));
  Labeller labeller;
  const auto& blobs = labeller.label(segmenter.bits(), segmenter.area(), 20);
  ASSERT_EQ(blobs.size(), 1U);
  EXPECT_NEAR(blobs[0].area_px, M_PI * 34 * 34, 350);  // a rim of 1.6 px
}

TEST_F(SegmenterTest, SegmentsObjectsNearNoiseLevelAsAWhole) {
  // 3 σ of a pixel's noise are a third of the floor's brightness. The discs differ from the floor by the same
  // amount.
  cv::Mat3b image = testing::dimFloor(model_, 24.0, 0.0, 10);
  truth_ = cv::Mat1b(image.size(), std::uint8_t{0});
  const std::vector<Disc> discs = {{160, 150, 20, {14, 15, 16}}, {480, 330, 16, {12, 16, 34}}};
  for (const auto& d : discs) {
    testing::drawDisc<cv::Vec3b>(image, d.u, d.v, d.r, d.colour);
    testing::drawDisc<std::uint8_t>(truth_, d.u, d.v, d.r, 255);
  }
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 3.0, 11)));
  Labeller labeller;
  EXPECT_EQ(labeller.label(segmenter.bits(), segmenter.area(), 20).size(), discs.size());
  const cv::Mat1b truth = truth_ > 127;
  const int common = cv::countNonZero(truth & segmenter.objects()),
            either = cv::countNonZero(truth | segmenter.objects());
  EXPECT_GT(common, 0.85 * either);  // a rim of one pixel around discs of 16 and 20 px gives 0.89
}

/// White objects on a warm floor of equal brightness. Their hue differs by 6 % of the brightness. Texture
/// changes the brightness of objects and floor from pixel to pixel.
class FaintHueTest : public SegmenterTest {
 protected:
  FaintHueTest() : image_(testing::unevenFloor(model_, 0.7, 0.0, 12)) {
    truth_ = cv::Mat1b(image_.size(), std::uint8_t{0});
  }
  void add(const Disc& d) {
    testing::drawDisc<cv::Vec3b>(image_, d.u, d.v, d.r, d.colour);
    testing::drawDisc<std::uint8_t>(truth_, d.u, d.v, d.r, 255);
  }
  /// Intersection over union of the true discs and the segmented objects.
  double overlap(double texture, double noise) {
    cv::Mat3b image = image_.clone();
    std::mt19937 random(13);
    std::normal_distribution<double> gauss(1.0, texture);
    for (auto& pixel : image) {
      const double light = gauss(random);
      for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(light * pixel[c]);
    }
    GroundSegmenter segmenter(camera_, view_, {});
    EXPECT_TRUE(segmenter.segment(testing::withNoise(image, noise, 14)));
    const cv::Mat1b truth = truth_ > 127;
    return static_cast<double>(cv::countNonZero(truth & segmenter.objects())) /
           cv::countNonZero(truth | segmenter.objects());
  }

  cv::Mat3b image_;
};

TEST_F(FaintHueTest, DistinguishesHuesHiddenByTexture) {
  add({160, 150, 20, {150, 150, 150}});
  add({480, 330, 16, {140, 140, 140}});
  for (const double texture : {0.08, 0.15}) EXPECT_GT(overlap(texture, 1.5), 0.85) << texture;
}

TEST_F(FaintHueTest, DistinguishesHuesHiddenByNoise) {
  add({160, 150, 20, {150, 150, 150}});
  add({480, 330, 16, {140, 140, 140}});
  EXPECT_GT(overlap(0.0, 4.0), 0.85);
}

TEST_F(FaintHueTest, JoinsFacesInDifferentLight) {
  add({160, 150, 24, {135, 135, 135}});
  image_(cv::Rect(130, 120, 60, 30)).setTo(cv::Vec3b(235, 235, 235), truth_(cv::Rect(130, 120, 60, 30)));
  EXPECT_GT(overlap(0.06, 2.0), 0.9);
}

// The parts of a grey object whose hue is not clearly different from the floor's are not its shadow.
TEST_F(FaintHueTest, SegmentsDimGreyObjectAsAWhole) {
  image_ = testing::dimFloor(model_, 64.0, 0.0, 17);
  add({160, 150, 24, {43, 42, 41}});
  image_(cv::Rect(130, 150, 60, 30)).setTo(cv::Vec3b(33, 33, 33), truth_(cv::Rect(130, 150, 60, 30)));
  EXPECT_GT(overlap(0.02, 1.5), 0.9);
}

TEST_F(FaintHueTest, ExcludesFaintHueFromSeeds) {
  add({450, 240, 30, {158, 158, 158}});  // in a bin of the histogram next to the floor's
  EXPECT_GT(overlap(0.03, 1.5), 0.85);
}

TEST_F(FaintHueTest, TreatsFaintTilesAsFloor) {
  for (int y = 0; y < image_.rows; ++y)
    for (int x = 0; x < image_.cols; ++x)
      if ((x / 40 + y / 40) % 3 == 0) image_(y, x)[0] = static_cast<std::uint8_t>(image_(y, x)[0] * 1.06);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(testing::withNoise(image_, 1.0, 15)));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
}

// The border of a carpet. Without noise single pixels are sufficient, and a limit halfway to the faint hue
// would be too strict.
TEST_F(FaintHueTest, TreatsCarpetBorderAsFloorWithoutNoise) {
  image_(cv::Rect(0, 0, 170, image_.rows)) += cv::Scalar(-7, 0, 7);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(testing::withNoise(image_, 0.4, 18)));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
}

TEST_F(SegmenterTest, SegmentsGreyImagesAndCarriesNothingOver) {
  cv::Mat3b image = testing::unevenFloor(model_, 0.5, 1.5, 6);
  const cv::Mat3b bare = image.clone();
  addDiscs(image);
  cv::Mat1b grey, bare_grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(bare, bare_grey, cv::COLOR_BGR2GRAY);
  GroundSegmenter segmenter(camera_, view_, {});
  ASSERT_TRUE(segmenter.segment(grey));
  expectDiscs(segmenter);
  const cv::Mat1b first = segmenter.objects().clone();
  ASSERT_TRUE(segmenter.segment(bare_grey));
  EXPECT_EQ(cv::countNonZero(segmenter.objects()), 0);
  ASSERT_TRUE(segmenter.segment(grey));
  EXPECT_EQ(cv::countNonZero(segmenter.objects() != first), 0);
}

TEST(SegmenterOptions, RejectsUnknownKeysAndValuesOutOfRange) {
  EXPECT_THROW(SegmenterOptions::read(options::Section::parse("method: magic", "t.yaml")), options::Error);
  EXPECT_THROW(SegmenterOptions::read(options::Section::parse("reference: {tolerance_along: 2}", "t.yaml")),
               options::Error);
  EXPECT_THROW(SegmenterOptions::read(options::Section::parse("reference: {tolerance: 0.1}", "t.yaml")),
               options::Error);
  EXPECT_EQ(SegmenterOptions::read(options::Section::parse("{method: histogram, max_line_px: 5}", "t.yaml"))
                .max_line_px,
            5);
}

}  // namespace
}  // namespace omnifleet::ground
