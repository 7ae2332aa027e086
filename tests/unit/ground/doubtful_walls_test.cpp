#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// A straight low wall beside the robot, of the floor's hue, and nothing that tells it from another floor.
class DoubtfulWallTest : public ::testing::Test {
 protected:
  static constexpr double kFrom_m = -1.2, kTo_m = 1.4, kThick_m = 0.06;
  static constexpr double kOff = 0.2;  // of a distance: steps are told by blocks of several pixels

  DoubtfulWallTest() : model_(testing::fisheye()), camera_(model_), view_(camera_, ViewOptions{}) {}

  /// What is seen at a pixel: where it is on the floor, and in how much of the floor's light.
  struct Seen {
    Eigen::Vector2d floor_m;
    double share = 1.0;
    bool is_wall = false;
  };
  std::optional<Seen> lookAt(int x, int y, double away_m, double high_m, double share) const {
    const auto ray = camera_.rayFromPixel({1.0 * x, 1.0 * y});
    const auto floor = camera_.floorFromPixel({1.0 * x, 1.0 * y});
    if (!ray || !floor) return std::nullopt;
    const double to_side = -away_m / ray->y(), to_top = (high_m - model_.position_m.z()) / ray->z();
    const Eigen::Vector3d side = model_.position_m + to_side * *ray, top = model_.position_m + to_top * *ray;
    const auto isBeside = [&](const Eigen::Vector3d& p) { return p.x() >= kFrom_m && p.x() <= kTo_m; };
    if (to_side > 0.0 && side.z() >= 0.0 && side.z() <= high_m && isBeside(side))
      return Seen{side.head<2>(), share, true};
    if (top.y() <= -away_m && top.y() >= -away_m - kThick_m && isBeside(top))
      return Seen{top.head<2>(), share, true};
    const double behind_m = -away_m - kThick_m - floor->y();
    const bool is_behind = behind_m > 0.0 && floor->x() >= kFrom_m && floor->x() <= kTo_m;
    return Seen{*floor, is_behind ? 1.0 - 0.08 * std::exp(-behind_m / 0.2) : 1.0, false};
  }

  /// @param high_m 0: none
  cv::Mat3b room(double away_m, double high_m, double share) const {
    cv::Mat3b image(model_.image_height_px, model_.image_width_px, cv::Vec3b(0, 0, 0));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const auto seen = lookAt(x, y, away_m, high_m, share);
        if (!seen) continue;
        const double light = seen->share * (0.65 + 0.35 / (1.0 + 0.1 * seen->floor_m.squaredNorm()));
        image(y, x) = {cv::saturate_cast<std::uint8_t>(112 * light),
                       cv::saturate_cast<std::uint8_t>(118 * light),
                       cv::saturate_cast<std::uint8_t>(120 * light)};
      }
    }
    return image;
  }
  cv::Mat3b seen(const cv::Mat3b& room, unsigned seed) const {
    return testing::withNoise(testing::blurred(room, 0.6), 1.3, seed);
  }

  static bool isIn(const std::vector<Blob>& regions, const cv::Point& at) {
    for (const Blob& region : regions)
      for (const ground::Run& run : region.runs)
        if (run.row == at.y && run.begin <= at.x && at.x < run.end) return true;
    return false;
  }
  /// How far the floor is sure, metres, in a direction of the wall (its x).
  double sureUpTo(const GroundSegmenter& segmenter, double away_m, double wall_x_m) const {
    const double bearing = std::atan2(-away_m, wall_x_m);
    for (double r = 0.4; r < 2.5; r += 0.01) {
      const auto pixel = camera_.pixelFromPoint({r * std::cos(bearing), r * std::sin(bearing), 0.0});
      const cv::Point at(cvRound(pixel->x()), cvRound(pixel->y()));
      if (segmenter.objects()(at) != 0) return r;
      for (const auto* doubtful : {&segmenter.undecided(), &segmenter.boards(), &segmenter.steps()})
        if (isIn(*doubtful, at)) return r;
    }
    return std::numeric_limits<double>::infinity();
  }
  /// Share of the wall's length where floor is sure up to its foot, or what may stand before it.
  double shareTold(const GroundSegmenter& segmenter, double away_m, double least = 1.0 - kOff) const {
    int told = 0, all = 0;
    for (double x = kFrom_m + 0.1; x < kTo_m - 0.1; x += 0.05) {
      const double foot_m = std::hypot(x, away_m), sure_m = sureUpTo(segmenter, away_m, x);
      told += sure_m > least * foot_m && sure_m < (1.0 + kOff) * foot_m ? 1 : 0;
      ++all;
    }
    return 1.0 * told / all;
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
};

TEST_F(DoubtfulWallTest, HardlyDarkerThanTheFloorIsTold) {
  for (const double away_m : {0.9, 1.2}) {
    for (const double share : {0.86, 0.89, 1.15}) {
      const cv::Mat3b image = room(away_m, 0.14, share);
      GroundSegmenter segmenter(camera_, view_, {});
      for (unsigned seed = 1; seed <= 3; ++seed) {
        ASSERT_TRUE(segmenter.segment(seen(image, seed)));
        EXPECT_GT(shareTold(segmenter, away_m), 0.8) << away_m << " m, " << share << ", " << seed;
      }
    }
  }
}

/// As a thing's shade it would be floor.
TEST_F(DoubtfulWallTest, BehindThingsOfOtherColoursIsNoShadeOfTheirs) {
  constexpr double kAway_m = 0.9;
  cv::Mat3b image = room(kAway_m, 0.2, 0.78);
  std::vector<cv::Point> things;
  for (const double x : {-0.7, 0.1, 0.9}) {  // tall enough to cover some of the wall
    const auto pixel = camera_.pixelFromPoint({x, -kAway_m + 0.05, 0.0});
    things.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
    const cv::Vec3b colour = x < 0.0 ? cv::Vec3b(160, 60, 40) : cv::Vec3b(26, 26, 28);
    testing::drawDisc<cv::Vec3b>(image, things.back().x, things.back().y, 16, colour);
  }
  GroundSegmenter segmenter(camera_, view_, {});
  for (unsigned seed = 1; seed <= 3; ++seed) {
    ASSERT_TRUE(segmenter.segment(seen(image, seed)));
    EXPECT_GT(shareTold(segmenter, kAway_m, 0.6), 0.9) << seed;
    for (const cv::Point& thing : things) EXPECT_EQ(segmenter.objects()(thing), 255);
  }
}

TEST_F(DoubtfulWallTest, WhereThereIsNoneNothingIsInDoubt) {
  cv::Mat3b bare = room(1.0, 0.0, 1.0), line = bare.clone(), blotched = bare.clone(), shadow = bare.clone();
  cv::Mat1f blotches(60, 60);
  cv::randn(blotches, 1.0, 0.03);  // 0.15 m each
  for (int y = 0; y < bare.rows; ++y) {
    for (int x = 0; x < bare.cols; ++x) {
      const auto floor = camera_.floorFromPixel({1.0 * x, 1.0 * y});
      if (!floor || floor->norm() > 4.0) continue;
      if (std::abs(floor->y() + 1.0) < 0.015) line(y, x) *= 0.6;
      const cv::Point2d at((floor->x() + 4.5) / 0.15, (floor->y() + 4.5) / 0.15);
      cv::Mat1f share;
      cv::getRectSubPix(blotches, {1, 1}, cv::Point2f(at), share);
      blotched(y, x) *= share(0, 0);
      // A lamp's shadow of a thing, with a half-shadow around it.
      const double across_m = std::abs(floor->x() - 0.3) - 0.12, along_m = -0.6 - floor->y();
      const double inside =
          1.0 / (1.0 + std::exp(std::max(across_m, std::max(-along_m, along_m - 0.5)) / 0.02));
      shadow(y, x) *= 1.0 - 0.3 * inside;
    }
  }
  const auto thing = camera_.pixelFromPoint({0.3, -0.6, 0.0});
  testing::drawDisc<cv::Vec3b>(shadow, thing->x(), thing->y(), 18, {30, 30, 190});
  int which = 0;
  for (const cv::Mat3b& image : {bare, line, blotched, shadow}) {
    GroundSegmenter segmenter(camera_, view_, {});
    for (unsigned seed = 1; seed <= 3; ++seed) {
      ASSERT_TRUE(segmenter.segment(seen(image, seed)));
      for (const auto* doubtful :
           {&segmenter.undecided(), &segmenter.boards(), &segmenter.steps(), &segmenter.grainy()})
        EXPECT_TRUE(doubtful->empty()) << which << " " << seed;
    }
    ++which;
  }
}

}  // namespace
}  // namespace omnifleet::ground
