// Detection of walls as bright as the floor, and of other floors, by their texture alone.

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/lamp_floor.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// A floor in even light; a function gives the brightness share of each pixel.
class CoarseTextureTest : public ::testing::TestWithParam<int> {
 protected:
  static constexpr double kTextureEdge_m = -0.9;  ///< metres; to the right of it the texture differs

  CoarseTextureTest()
      : model_(testing::fisheye(GetParam(), GetParam() * 3 / 4)), camera_(model_), view_(camera_, {}) {}

  /// White noise at 1/160 of the image width: as coarse as plaster at 1 m distance.
  cv::Mat1f texture(double sigma, unsigned seed) const {
    cv::Mat1f coarse(120, 160), fine;
    cv::theRNG().state = seed;
    cv::randn(coarse, 1.0, sigma);
    cv::resize(coarse, fine, {model_.image_width_px, model_.image_height_px}, 0, 0, cv::INTER_LINEAR);
    return fine;
  }
  using Share = std::function<double(const Eigen::Vector2d& floor_m, const cv::Point&)>;
  /// Each pixel is the mean of nine samples.
  cv::Mat3b picture(const Share& share) const {
    cv::Mat3b image(model_.image_height_px, model_.image_width_px, cv::Vec3b(0, 0, 0));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        double light = 0.0;
        int seen = 0;
        for (int k = 0; k < 9; ++k) {
          const auto floor = camera_.floorFromPixel({x + (k % 3 - 1) / 3.0, y + (k / 3 - 1) / 3.0});
          if (!floor) continue;
          light += share(*floor, {x, y});
          ++seen;
        }
        if (seen == 0) continue;
        for (int c = 0; c < 3; ++c)
          image(y, x)[c] = cv::saturate_cast<std::uint8_t>((118.0 + 4.0 * c) * light / seen);
      }
    }
    return image;
  }
  /// Reported share of the floor pixels within 2 m that `which` selects.
  double reportedShare(const GroundSegmenter& segmenter,
                       const std::function<bool(const Eigen::Vector2d&)>& which) const {
    cv::Mat1b mask(view_.imageSize(), std::uint8_t{0});
    for (const Blob& region : segmenter.coarseTexture())
      for (const ground::Run& run : region.runs) mask.row(run.row).colRange(run.begin, run.end) = 255;
    int all = 0, marked = 0;
    for (int y = 0; y < mask.rows; ++y) {
      for (int x = 0; x < mask.cols; ++x) {
        const auto floor = camera_.floorFromPixel({1.0 * x, 1.0 * y});
        if (!floor || view_.mask()(y, x) == 0 || floor->norm() > 2.0 || !which(*floor)) continue;
        ++all;
        marked += mask(y, x) != 0 ? 1 : 0;
      }
    }
    return 1.0 * marked / all;
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
};

TEST_P(CoarseTextureTest, ReportsFarCoarserSurface) {
  const cv::Mat1f fine = texture(0.01, 1), coarse = texture(0.1, 2);
  const cv::Mat3b image = picture([&](const Eigen::Vector2d& at, const cv::Point& px) {
    return at.y() < kTextureEdge_m ? coarse(px) : fine(px);
  });
  for (unsigned seed = 1; seed <= 3; ++seed) {
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 1.5, seed)));
    EXPECT_GT(reportedShare(segmenter, [](const auto& at) { return at.y() < kTextureEdge_m - 0.1; }), 0.9)
        << seed;
    EXPECT_LT(reportedShare(segmenter, [](const auto& at) { return at.y() > kTextureEdge_m + 0.15; }), 0.005)
        << seed;
  }
}

TEST_P(CoarseTextureTest, IgnoresOwnTextureLinesGradientsAndNoise) {
  const cv::Mat1f coarse = texture(0.05, 7);
  const auto isJoint = [](double m) { return std::abs(std::remainder(m, 0.3)) < 0.004; };
  const std::vector<Share> floors = {
      [&](const Eigen::Vector2d&, const cv::Point& px) { return coarse(px); },  // all over
      [&](const Eigen::Vector2d& at, const cv::Point&) {
        return isJoint(at.x()) || isJoint(at.y()) ? 0.7 : 1.0;
      },
      [](const Eigen::Vector2d& at, const cv::Point&) { return 0.3 + 0.7 / (1.0 + 0.3 * at.squaredNorm()); },
      [](const Eigen::Vector2d& at, const cv::Point&) {
        return at.y() < -0.8 ? 0.8 : 1.0;
      },  // an intensity edge
  };
  for (std::size_t i = 0; i < floors.size(); ++i) {
    const cv::Mat3b image = picture(floors[i]);
    for (unsigned seed = 1; seed <= 3; ++seed) {
      GroundSegmenter segmenter(camera_, view_, {});
      ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 1.5, seed)));
      EXPECT_TRUE(segmenter.coarseTexture().empty()) << i << " " << seed;
    }
  }
}

/// The lamp model evens out the illumination and amplifies the noise by the same factor.
TEST_P(CoarseTextureTest, IgnoresNoiseFarFromALamp) {
  for (const double height_m : {0.8, 1.5}) {
    const cv::Mat3b image = testing::floorUnder({height_m, 0.0}, camera_, testing::kLinear);
    GroundSegmenter segmenter(camera_, view_, {});
    for (unsigned seed = 1; seed <= 8; ++seed) {
      ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 2.0, seed)));
      EXPECT_TRUE(segmenter.coarseTexture().empty()) << height_m << " m, " << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Width, CoarseTextureTest,
                         ::testing::Values(640, 960)  // blocks of one cell, and of four
);

}  // namespace
}  // namespace omnifleet::ground
