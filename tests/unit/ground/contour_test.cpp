#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "ground/contour.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

class ContourTest : public ::testing::Test {
 protected:
  ContourTest() : camera_(testing::fisheye()), view_(camera_, ViewOptions{}) {}

  Contour trace(const cv::Mat& image, const cv::Mat1b& mask, bool refine) {
    ContourOptions options;
    options.refine = refine;
    ContourTracer tracer(view_, options);
    std::vector<Strip> strips;
    for (int y = 0; y < mask.rows / FloorView::kCell; ++y) strips.push_back({y, 0, mask.cols});
    Labeller labeller;
    Blob all;
    for (const auto& blob : labeller.label(mask, strips, 1))
      all.runs.insert(all.runs.end(), blob.runs.begin(), blob.runs.end());
    std::sort(all.runs.begin(), all.runs.end(), [](const ground::Run& a, const ground::Run& b) {
      return std::tie(a.row, a.begin) < std::tie(b.row, b.begin);
    });
    Contour contour;
    const cv::Mat3f floor(view_.cells(), cv::Vec3f(160, 160, 160));
    cv::Mat1b grey = image;
    tracer.trace({image, grey, mask, floor}, all, contour);
    return contour;
  }

  static double loopArea(const Contour& contour, std::size_t loop) {
    const std::size_t begin = contour.loop_begin[loop];
    const std::size_t end =
        loop + 1 < contour.loop_begin.size() ? contour.loop_begin[loop + 1] : contour.points_px.size();
    double twice = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      const auto a = contour.points_px[i].cast<double>(),
                 b = contour.points_px[i + 1 < end ? i + 1 : begin].cast<double>();
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return 0.5 * twice;
  }

  lens::Camera camera_;
  FloorView view_;
};

TEST_F(ContourTest, PointsAreTheMidpointsOfPixelEdges) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  mask(cv::Rect(100, 200, 3, 2)).setTo(255);
  const Contour contour = trace(mask, mask, false);
  ASSERT_EQ(contour.loop_begin.size(), 1U);
  ASSERT_EQ(contour.points_px.size(), 10U);  // the perimeter in pixel edges
  for (const auto& p : contour.points_px) {
    const bool horizontal = p.y() == 199.5f || p.y() == 201.5f, vertical = p.x() == 99.5f || p.x() == 102.5f;
    EXPECT_TRUE(horizontal != vertical) << p.transpose();
  }
  EXPECT_GT(loopArea(contour, 0), 0.0);  // v down: positive is clockwise on the screen
}

TEST_F(ContourTest, HolesAreLeftOutAndPiecesFollowedOneByOne) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  cv::circle(mask, {110, 200}, 20, 255, cv::FILLED);
  cv::circle(mask, {112, 203}, 9, 0, cv::FILLED);
  mask(cv::Rect(110, 200, 3, 3)).setTo(255);  // an island in the hole
  mask(cv::Rect(300, 400, 10, 10)).setTo(255);
  const Contour contour = trace(mask, mask, false);
  ASSERT_EQ(contour.loop_begin.size(), 3U);
  cv::Mat1b filled(480, 640, std::uint8_t{0});
  cv::circle(filled, {110, 200}, 20, 255, cv::FILLED);
  // Cutting each pixel corner takes half of a corner triangle's 1/4 px² away; the corners number at most the
  // perimeter.
  EXPECT_NEAR(loopArea(contour, 0), cv::countNonZero(filled), 0.125 * 130);
  EXPECT_NEAR(loopArea(contour, 2), 100.0, 0.5 + 1e-6);
}

TEST_F(ContourTest, DiagonalNeighboursBelongTogether) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  for (int i = 0; i < 5; ++i) mask(200 + i, 100 + i) = 255;
  const Contour contour = trace(mask, mask, false);
  EXPECT_EQ(contour.loop_begin.size(), 1U);
  EXPECT_EQ(contour.points_px.size(), 20U);
}

TEST_F(ContourTest, RefinementFindsTheEdgeOfADiscToAFewHundredthsOfAPixel) {
  for (const double level : {30.0, 90.0, 235.0}) {
    cv::Mat1b image(480, 640, std::uint8_t{160});
    testing::drawDisc<std::uint8_t>(image, 150.3, 260.7, 24.4, cv::saturate_cast<std::uint8_t>(level));
    // The mask as the segmentation makes it: whatever is a little unlike the floor, so it is up to a pixel
    // too large.
    const cv::Mat1b mask = cv::abs(image - 160) > 10;
    const Contour rough = trace(image, mask, false), fine = trace(image, mask, true);
    const auto statistics = [](const Contour& contour) {
      double mean = 0, square = 0;
      for (const auto& p : contour.points_px) {
        const double r = std::hypot(p.x() - 150.3, p.y() - 260.7) - 24.4;
        mean += r;
        square += r * r;
      }
      mean /= static_cast<double>(contour.points_px.size());
      return std::make_pair(mean,
                            std::sqrt(square / static_cast<double>(contour.points_px.size()) - mean * mean));
    };
    EXPECT_GT(statistics(rough).first, 0.15);
    // Box-filtered pixels interpolated linearly and a polygonal normal leave a few hundredths.
    EXPECT_NEAR(statistics(fine).first, 0.0, 0.06) << level;
    EXPECT_LT(statistics(fine).second, 0.12) << level;
  }
}

TEST_F(ContourTest, LowContrastStaysAtTheMidpoints) {
  cv::Mat1b image(480, 640, std::uint8_t{160});
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  mask(cv::Rect(100, 200, 20, 20)).setTo(255);
  const Contour rough = trace(image, mask, false), fine = trace(image, mask, true);
  EXPECT_EQ(rough.points_px, fine.points_px);
}

}  // namespace
}  // namespace omnifleet::ground
