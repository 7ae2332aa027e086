#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "ground/contour.h"
#include "tests/unit/ground/bits.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

class ContourTest : public ::testing::Test {
 protected:
  ContourTest() : camera_(testing::fisheye()), view_(camera_, ViewOptions{}) {}

  /// Mean radial error in pixels of the outline of a disc around (150.3, 260.7). It is refined from a mask of
  /// all pixels that the disc touches.
  double meanError(const cv::Mat3b& image, double radius_px, float hue_noise = 0.0f) {
    cv::Mat1b mask(image.size(), std::uint8_t{0});
    testing::drawDisc<std::uint8_t>(mask, 150.3, 260.7, radius_px, 255);
    const Contour contour = trace(image, mask > 0, true, hue_noise);
    double sum = 0.0;
    for (const auto& p : contour.points_px) sum += std::hypot(p.x() - 150.3, p.y() - 260.7) - radius_px;
    return sum / static_cast<double>(contour.points_px.size());
  }

  Contour trace(const cv::Mat& image, const cv::Mat1b& mask, bool refine, float hue_noise = 0.0f) {
    ContourOptions options;
    options.refine = refine;
    ContourTracer tracer(view_, options);
    const testing::Bits bits(mask);
    Labeller labeller;
    Blob all;
    for (const auto& blob : labeller.label(bits.mask, bits.area, 1))
      all.runs.insert(all.runs.end(), blob.runs.begin(), blob.runs.end());
    std::sort(all.runs.begin(), all.runs.end(), [](const ground::Run& a, const ground::Run& b) {
      return std::tie(a.row, a.begin) < std::tie(b.row, b.begin);
    });
    Contour contour;
    const cv::Mat3f floor(view_.cells(), cv::Vec3f(160, 160, 160));
    cv::Mat1b grey;
    if (image.channels() == 3)
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    else
      grey = image;
    tracer.trace({image, grey, mask, floor, hue_noise}, all, contour);
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

  /// A dark shape on a bright floor. Every pixel is the mean of 16 × 16 samples.
  template <typename Inside>
  static cv::Mat1b drawn(const Inside& isInside) {
    constexpr int kSub = 16;
    cv::Mat1b image(480, 640, std::uint8_t{160});
    for (int y = 200; y < 320; ++y) {
      for (int x = 90; x < 210; ++x) {
        int inside = 0;
        for (int k = 0; k < kSub * kSub; ++k)
          inside +=
              isInside(Eigen::Vector2d(x + (k % kSub + 0.5) / kSub - 0.5, y + (k / kSub + 0.5) / kSub - 0.5));
        image(y, x) = cv::saturate_cast<std::uint8_t>(160.0 - 130.0 * inside / (kSub * kSub));
      }
    }
    return image;
  }

  /// Mean and worst difference between the outline's support function and the true one, pixels. Positive: too
  /// far outside.
  template <typename Support>
  std::pair<double, double> supportError(const cv::Mat1b& image, const Eigen::Vector2d& middle,
                                         const Support& support) {
    const Contour contour = trace(image, cv::abs(image - 160) > 10, true);
    double mean = 0.0, worst = 0.0;
    constexpr int kDirections = 96;
    for (int k = 0; k < kDirections; ++k) {
      const Eigen::Vector2d n(std::cos(2.0 * M_PI * k / kDirections), std::sin(2.0 * M_PI * k / kDirections));
      double reach = -1e9;
      for (const auto& p : contour.points_px) reach = std::max(reach, n.dot(p.cast<double>() - middle));
      mean += (reach - support(n)) / kDirections;
      if (std::abs(reach - support(n)) > std::abs(worst)) worst = reach - support(n);
    }
    return {mean, worst};
  }

  lens::Camera camera_;
  FloorView view_;
};

TEST_F(ContourTest, TracesMidpointsOfPixelEdges) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  mask(cv::Rect(100, 200, 3, 2)).setTo(255);
  const Contour contour = trace(mask, mask, false);
  ASSERT_EQ(contour.loop_begin.size(), 1U);
  ASSERT_EQ(contour.points_px.size(), 10U);  // perimeter in pixel edges
  for (const auto& p : contour.points_px) {
    const bool horizontal = p.y() == 199.5f || p.y() == 201.5f, vertical = p.x() == 99.5f || p.x() == 102.5f;
    EXPECT_TRUE(horizontal != vertical) << p.transpose();
  }
  EXPECT_GT(loopArea(contour, 0), 0.0);  // v down: positive is clockwise on the screen
}

TEST_F(ContourTest, OmitsHolesAndTracesEachPiece) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  cv::circle(mask, {110, 200}, 20, 255, cv::FILLED);
  cv::circle(mask, {112, 203}, 9, 0, cv::FILLED);
  mask(cv::Rect(110, 200, 3, 3)).setTo(255);  // an island in the hole
  mask(cv::Rect(300, 400, 10, 10)).setTo(255);
  const Contour contour = trace(mask, mask, false);
  ASSERT_EQ(contour.loop_begin.size(), 3U);
  cv::Mat1b filled(480, 640, std::uint8_t{0});
  cv::circle(filled, {110, 200}, 20, 255, cv::FILLED);
  // Each cut pixel corner removes half of a corner triangle's 1/4 px². The number of corners is at most the
  // perimeter.
  EXPECT_NEAR(loopArea(contour, 0), cv::countNonZero(filled), 0.125 * 130);
  EXPECT_NEAR(loopArea(contour, 2), 100.0, 0.5 + 1e-6);
}

TEST_F(ContourTest, ConnectsDiagonalNeighbours) {
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  for (int i = 0; i < 5; ++i) mask(200 + i, 100 + i) = 255;
  const Contour contour = trace(mask, mask, false);
  EXPECT_EQ(contour.loop_begin.size(), 1U);
  EXPECT_EQ(contour.points_px.size(), 20U);
}

TEST_F(ContourTest, RefinesDiscEdgeToHundredthsOfAPixel) {
  for (const double level : {30.0, 90.0, 235.0}) {
    cv::Mat1b image(480, 640, std::uint8_t{160});
    testing::drawDisc<std::uint8_t>(image, 150.3, 260.7, 24.4, cv::saturate_cast<std::uint8_t>(level));
    // A mask as the segmentation makes it: all pixels that differ slightly from the floor. It is up to one
    // pixel too large.
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
    // Linear interpolation of box-filtered pixels and a polygonal normal leave a few hundredths of a pixel.
    EXPECT_NEAR(statistics(fine).first, 0.0, 0.06) << level;
    EXPECT_LT(statistics(fine).second, 0.12) << level;
  }
}

TEST_F(ContourTest, ExcludesSoftShadowBesideObject) {
  // Less light reaches the floor beside an object: up to 30 % less, over a few pixels.
  for (const auto& [reach_px, most_px] : std::map<double, double>{{2.0, 0.28}, {4.0, 0.19}, {8.0, 0.09}}) {
    cv::Mat1b image(480, 640, std::uint8_t{160});
    constexpr int kSub = 8;
    for (int y = 220; y < 300; ++y) {
      for (int x = 110; x < 190; ++x) {
        double sum = 0.0;
        for (int k = 0; k < kSub * kSub; ++k) {
          const double r = std::hypot(x + (k % kSub + 0.5) / kSub - 0.5 - 150.3,
                                      y + (k / kSub + 0.5) / kSub - 0.5 - 260.7) -
                           24.4;
          sum += r < 0.0 ? 50.0 : 160.0 * (1.0 - 0.3 * std::max(0.0, 1.0 - r / reach_px));
        }
        image(y, x) = cv::saturate_cast<std::uint8_t>(sum / (kSub * kSub));
      }
    }
    const Contour contour = trace(image, image < 100, true);
    double mean = 0.0;
    for (const auto& p : contour.points_px)
      mean +=
          (std::hypot(p.x() - 150.3, p.y() - 260.7) - 24.4) / static_cast<double>(contour.points_px.size());
    // The position halfway between object and plain floor lies 0.32, 0.33 and 0.16 px too far outside.
    EXPECT_NEAR(mean, 0.0, most_px) << reach_px;
  }
}

/// A cast shadow of which only a narrow rim is visible before the object. It is hardly brighter than the
/// object.
TEST_F(ContourTest, ExcludesNarrowShadowBesideObjectOfOtherHue) {
  for (const bool faint : {false, true}) {
    for (const double width_px : {1.0, 1.5, 2.5}) {
      cv::Mat3b image(480, 640, cv::Vec3b(160, 160, 160));
      const cv::Vec3b shadow = faint ? cv::Vec3b(120, 120, 120) : cv::Vec3b(80, 80, 80),
                      object = faint ? cv::Vec3b(127, 118, 109) : cv::Vec3b(50, 75, 30);
      testing::drawDisc<cv::Vec3b>(image, 150.3, 260.7, 24.4 + width_px, shadow);
      testing::drawDisc<cv::Vec3b>(image, 150.3, 260.7, 24.4, object);
      EXPECT_NEAR(meanError(image, 24.4), 0.0, 0.1) << width_px;  // by brightness: most of the shadow's width
    }
  }
}

TEST_F(ContourTest, IgnoresFaintHueHiddenByNoise) {
  cv::Mat3b image(480, 640, cv::Vec3b(160, 160, 160));
  testing::drawDisc<cv::Vec3b>(image, 150.3, 260.7, 24.4, {127, 118, 109});
  EXPECT_NEAR(meanError(testing::withNoise(image, 12.0, 3), 24.4, 12.0f), 0.0, 0.1);
}

TEST_F(ContourTest, RestoresCornersToTenthsOfAPixel) {
  const Eigen::Vector2d middle(150.2, 260.4), half(28.0, 19.0);
  for (const double turn : {0.2, 0.5, 0.9, 1.3}) {
    const Eigen::Matrix2d axes = Eigen::Rotation2Dd(turn).toRotationMatrix();
    const cv::Mat1b image = drawn([&](const Eigen::Vector2d& p) {
      const Eigen::Vector2d q = (axes.transpose() * (p - middle)).cwiseAbs();
      return q.x() < half.x() && q.y() < half.y();
    });
    const auto [mean, worst] = supportError(
        image, middle, [&](const Eigen::Vector2d& n) { return half.dot((axes.transpose() * n).cwiseAbs()); });
    EXPECT_NEAR(mean, 0.0, 0.1) << turn;
    EXPECT_NEAR(worst, 0.0, 0.35) << turn;
  }
}

TEST_F(ContourTest, KeepsNarrowRoundEndsRound) {
  const Eigen::Vector2d middle(150.2, 260.4);
  for (const double narrow : {6.0, 9.0, 13.0}) {  // radii of 1 to 5 px at the ends
    const Eigen::Vector2d half(34.0, narrow);
    for (const double turn : {0.2, 0.5, 0.9, 1.3}) {
      const Eigen::Matrix2d axes = Eigen::Rotation2Dd(turn).toRotationMatrix();
      const cv::Mat1b image = drawn([&](const Eigen::Vector2d& p) {
        return (axes.transpose() * (p - middle)).cwiseQuotient(half).squaredNorm() < 1.0;
      });
      const auto [mean, worst] = supportError(image, middle, [&](const Eigen::Vector2d& n) {
        return (axes.transpose() * n).cwiseProduct(half).norm();
      });
      EXPECT_NEAR(mean, 0.0, 0.1) << narrow << " " << turn;
      EXPECT_NEAR(worst, 0.0, 0.35) << narrow << " " << turn;
    }
  }
}

TEST_F(ContourTest, KeepsMidpointsAtLowContrast) {
  cv::Mat1b image(480, 640, std::uint8_t{160});
  cv::Mat1b mask(480, 640, std::uint8_t{0});
  mask(cv::Rect(100, 200, 20, 20)).setTo(255);
  const Contour rough = trace(image, mask, false), fine = trace(image, mask, true);
  EXPECT_EQ(rough.points_px, fine.points_px);
}

}  // namespace
}  // namespace omnifleet::ground
