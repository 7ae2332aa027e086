#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "flow/harris.h"
#include "tests/unit/flow/texture.h"

namespace omnifleet::flow {
namespace {

ground::Blob block(int x, int y, int width, int height) {
  ground::Blob blob;
  blob.rect = {x, y, width, height};
  blob.area_px = width * height;
  for (int row = y; row < y + height; ++row) blob.runs.push_back({row, x, x + width});
  return blob;
}

/// Eq. 2 written out with OpenCV filters: central differences, products, Gaussian window, det − k·trace².
cv::Mat1d referenceResponse(const cv::Mat1b& grey, const HarrisOptions& options) {
  const cv::Mat1d kernel = (cv::Mat1d(1, 3) << -0.5, 0.0, 0.5);
  cv::Mat1d image, dx, dy, xx, xy, yy;
  grey.convertTo(image, CV_64F);
  cv::filter2D(image, dx, CV_64F, kernel);
  cv::filter2D(image, dy, CV_64F, kernel.t());
  const int side = 2 * static_cast<int>(std::ceil(2.0 * options.sigma_px)) + 1;
  const auto window = [&](const cv::Mat1d& product, cv::Mat1d& out) {
    cv::GaussianBlur(product, out, {side, side}, options.sigma_px, options.sigma_px);
  };
  window(dx.mul(dx), xx);
  window(dx.mul(dy), xy);
  window(dy.mul(dy), yy);
  const cv::Mat1d trace = xx + yy;
  return xx.mul(yy) - xy.mul(xy) - options.k * trace.mul(trace);
}

TEST(Harris, MatchesEquation2) {
  const cv::Mat1b grey = testing::Texture(6.0, 1).image(120, 100);
  HarrisOptions options;
  Harris harris(options);
  cv::Mat1f response;
  const cv::Rect rect(20, 15, 70, 60);
  harris.response(grey, rect, response);
  const cv::Mat1d reference = referenceResponse(grey, options);
  double largest = 0;
  cv::minMaxLoc(cv::abs(reference), nullptr, &largest);
  for (int y = 0; y < rect.height; ++y)
    for (int x = 0; x < rect.width; ++x)
      ASSERT_NEAR(response(y, x), reference(rect.y + y, rect.x + x),
                  1e-4 * largest);  // float compared with double
}

TEST(Harris, FindsChessboardCornersLikeOpenCv) {
  cv::Mat1b board(160, 160);
  for (int y = 0; y < 160; ++y)
    for (int x = 0; x < 160; ++x) board(y, x) = ((x / 20) + (y / 20)) % 2 != 0 ? 200 : 60;
  cv::GaussianBlur(board, board, {5, 5}, 1.0);
  Harris harris(HarrisOptions{});
  const auto& corners = harris.detect(board, {block(10, 10, 140, 140)});
  ASSERT_EQ(corners.size(), 20U);  // maximum of the option; the board has 49 inside
  cv::Mat1f box;
  cv::cornerHarris(board, box, 5, 3, 0.04);
  double strongest = 0;
  cv::minMaxLoc(box, nullptr, &strongest);
  for (const auto& corner : corners) {
    const Eigen::Vector2f cell = (corner.pixel + Eigen::Vector2f(0.5f, 0.5f)) / 20.0f;
    EXPECT_NEAR(std::round(cell.x()) * 20.0f, corner.pixel.x() + 0.5f, 1.1f);
    EXPECT_NEAR(std::round(cell.y()) * 20.0f, corner.pixel.y() + 0.5f, 1.1f);
    const cv::Rect near(static_cast<int>(corner.pixel.x()) - 1, static_cast<int>(corner.pixel.y()) - 1, 3, 3);
    double here = 0;
    cv::minMaxLoc(box(near), nullptr, &here);
    EXPECT_GT(
        here,
        0.5 * strongest);  // the box window has its maximum within one pixel of that of the Gaussian window
  }
}

TEST(Harris, SearchesLargeRegionsAtHalfResolution) {
  cv::Mat1b board(160, 160), half;
  for (int y = 0; y < 160; ++y)
    for (int x = 0; x < 160; ++x) board(y, x) = ((x / 20) + (y / 20)) % 2 != 0 ? 200 : 60;
  cv::pyrDown(board, half);
  Harris harris(HarrisOptions{});
  const std::vector<ground::Blob> regions{block(11, 11, 139, 139), block(14, 14, 52, 52)};
  const std::vector<Corner> whole = harris.detect(board, regions);
  const std::vector<Corner> found = harris.detect(board, half, regions, {0, 1});
  const auto inFirst = [](const std::vector<Corner>& corners) {
    return std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.blob == 0; });
  };
  EXPECT_EQ(inFirst(found), 20);
  for (const Corner& corner : found) {
    for (const float at : {corner.pixel.x(), corner.pixel.y()}) {
      const float off = std::remainder(at - 19.5f, 20.0f);  // the corner lies between two pixels
      EXPECT_LE(std::abs(off), 1.5f) << corner.pixel.transpose();
      if (corner.blob == 0) {
        EXPECT_EQ(std::fmod(at, 2.0f), 0.0f);
      }
    }
  }
  // The corners of the small region are unchanged.
  ASSERT_EQ(found.size() - 20U, whole.size() - 20U);
  for (std::size_t i = 20; i < found.size(); ++i) EXPECT_EQ(found[i].pixel, whole[i].pixel);
}

TEST(Harris, FindsCornersOnlyInLabelledRegions) {
  const cv::Mat1b grey = testing::Texture(6.0, 2).image(160, 120);
  Harris harris(HarrisOptions{});
  const std::vector<ground::Blob> blobs = {block(10, 10, 30, 30), block(90, 60, 40, 20)};
  const auto& corners = harris.detect(grey, blobs);
  ASSERT_FALSE(corners.empty());
  for (const auto& c : corners)
    EXPECT_TRUE(
        blobs[c.blob].rect.contains(cv::Point(static_cast<int>(c.pixel.x()), static_cast<int>(c.pixel.y()))));
  EXPECT_TRUE(harris.detect(grey, {}).empty());
}

TEST(Harris, AppliesThresholdPerLabelOrPerFrame) {
  cv::Mat1b grey = testing::Texture(6.0, 3).image(160, 120);
  cv::Mat1b faint = grey(cv::Rect(80, 0, 80, 120));
  faint.convertTo(faint, CV_8U, 0.1, 115.0);  // a tenth of the contrast, so a ten-thousandth of the response
  const std::vector<ground::Blob> blobs = {block(5, 5, 60, 100), block(90, 5, 60, 100)};
  HarrisOptions options;
  options.m = 0.3;
  const auto countOf = [&](bool per_label, std::size_t blob) {
    options.per_label = per_label;
    Harris harris(options);
    int n = 0;
    for (const auto& c : harris.detect(grey, blobs)) n += c.blob == blob ? 1 : 0;
    return n;
  };
  EXPECT_GT(countOf(true, 0), 0);
  EXPECT_GT(countOf(true, 1), 0);
  EXPECT_GT(countOf(false, 0), 0);
  EXPECT_EQ(countOf(false, 1), 0);
}

TEST(Harris, KeepsStrongestCornersAtMinimumDistance) {
  const cv::Mat1b grey = testing::Texture(5.0, 4).image(160, 120);
  HarrisOptions options;
  options.max_per_label = 7;
  options.min_distance_px = 12.0;
  Harris harris(options);
  const auto corners = harris.detect(grey, {block(5, 5, 150, 110)});
  ASSERT_EQ(corners.size(), 7U);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    EXPECT_LE(corners[i].response, corners[i == 0 ? 0 : i - 1].response);
    for (std::size_t k = 0; k < i; ++k) EXPECT_GE((corners[i].pixel - corners[k].pixel).norm(), 12.0f);
  }
}

}  // namespace
}  // namespace omnifleet::flow
