// Walls as light as the floor, and other floors: told by their grain alone.

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/lamp_floor.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// A floor in even light, by what share of it each pixel shows.
class GrainyFloorTest : public ::testing::TestWithParam<int> {
 protected:
  static constexpr double kGrainy_m = -0.9;  ///< from there to the right there is another grain

  GrainyFloorTest()
      : model_(testing::fisheye(GetParam(), GetParam() * 3 / 4)), camera_(model_), view_(camera_, {}) {}

  /// White noise of a picture's 1/160: as coarse as plaster a metre away.
  cv::Mat1f grain(double sigma, unsigned seed) const {
    cv::Mat1f coarse(120, 160), fine;
    cv::theRNG().state = seed;
    cv::randn(coarse, 1.0, sigma);
    cv::resize(coarse, fine, {model_.image_width_px, model_.image_height_px}, 0, 0, cv::INTER_LINEAR);
    return fine;
  }
  using Share = std::function<double(const Eigen::Vector2d& floor_m, const cv::Point&)>;
  /// Each pixel sees what nine points of it see.
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
  /// Share of what is told, of the pixels of the floor within 2 m that `which` names.
  double told(const GroundSegmenter& segmenter,
              const std::function<bool(const Eigen::Vector2d&)>& which) const {
    cv::Mat1b mask(view_.imageSize(), std::uint8_t{0});
    for (const Blob& region : segmenter.grainy())
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

TEST_P(GrainyFloorTest, WhatIsFarGrainierThanTheFloorAroundTheRobotIsTold) {
  const cv::Mat1f fine = grain(0.01, 1), coarse = grain(0.1, 2);
  const cv::Mat3b image = picture([&](const Eigen::Vector2d& at, const cv::Point& px) {
    return at.y() < kGrainy_m ? coarse(px) : fine(px);
  });
  for (unsigned seed = 1; seed <= 3; ++seed) {
    GroundSegmenter segmenter(camera_, view_, {});
    ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 1.5, seed)));
    EXPECT_GT(told(segmenter, [](const auto& at) { return at.y() < kGrainy_m - 0.1; }), 0.9) << seed;
    EXPECT_LT(told(segmenter, [](const auto& at) { return at.y() > kGrainy_m + 0.15; }), 0.005) << seed;
  }
}

TEST_P(GrainyFloorTest, NeitherItsOwnGrainNorLinesLightOrNoiseAre) {
  const cv::Mat1f coarse = grain(0.05, 7);
  const auto isJoint = [](double m) { return std::abs(std::remainder(m, 0.3)) < 0.004; };
  const std::vector<Share> floors = {
      [&](const Eigen::Vector2d&, const cv::Point& px) { return coarse(px); },  // all over
      [&](const Eigen::Vector2d& at, const cv::Point&) {
        return isJoint(at.x()) || isJoint(at.y()) ? 0.7 : 1.0;
      },
      [](const Eigen::Vector2d& at, const cv::Point&) { return 0.3 + 0.7 / (1.0 + 0.3 * at.squaredNorm()); },
      [](const Eigen::Vector2d& at, const cv::Point&) { return at.y() < -0.8 ? 0.8 : 1.0; },  // an edge
  };
  for (std::size_t i = 0; i < floors.size(); ++i) {
    const cv::Mat3b image = picture(floors[i]);
    for (unsigned seed = 1; seed <= 3; ++seed) {
      GroundSegmenter segmenter(camera_, view_, {});
      ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 1.5, seed)));
      EXPECT_TRUE(segmenter.grainy().empty()) << i << " " << seed;
    }
  }
}

/// The model of a lamp evens the light out, and makes as much more of the noise.
TEST_P(GrainyFloorTest, NorIsTheNoiseFarFromALamp) {
  for (const double height_m : {0.8, 1.5}) {
    const cv::Mat3b image = testing::floorUnder({height_m, 0.0}, camera_, testing::kLinear);
    GroundSegmenter segmenter(camera_, view_, {});
    for (unsigned seed = 1; seed <= 8; ++seed) {
      ASSERT_TRUE(segmenter.segment(testing::withNoise(image, 2.0, seed)));
      EXPECT_TRUE(segmenter.grainy().empty()) << height_m << " m, " << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Width, GrainyFloorTest,
                         ::testing::Values(640, 960)  // blocks of one cell, and of four
);

}  // namespace
}  // namespace omnifleet::ground
