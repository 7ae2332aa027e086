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

/// A straight low wall of the floor's hue beside the robot. Nothing distinguishes it from another floor.
class UndecidedWallTest : public ::testing::Test {
 protected:
  static constexpr double kFrom_m = -1.2, kTo_m = 1.4, kThick_m = 0.06;
  static constexpr double kTolerance =
      0.2;  // share of a distance; edges are located in blocks of several pixels

  UndecidedWallTest() : model_(testing::fisheye()), camera_(model_), view_(camera_, ViewOptions{}) {}

  /// What a pixel shows: its position on the floor, and its brightness relative to the floor's.
  struct Observation {
    Eigen::Vector2d floor_m;
    double share = 1.0;
    bool is_wall = false;
  };
  std::optional<Observation> observe(int x, int y, double away_m, double high_m, double share) const {
    const auto ray = camera_.rayFromPixel({1.0 * x, 1.0 * y});
    const auto floor = camera_.floorFromPixel({1.0 * x, 1.0 * y});
    if (!ray || !floor) return std::nullopt;
    const double to_side = -away_m / ray->y(), to_top = (high_m - model_.position_m.z()) / ray->z();
    const Eigen::Vector3d side = model_.position_m + to_side * *ray, top = model_.position_m + to_top * *ray;
    const auto isBeside = [&](const Eigen::Vector3d& p) { return p.x() >= kFrom_m && p.x() <= kTo_m; };
    if (to_side > 0.0 && side.z() >= 0.0 && side.z() <= high_m && isBeside(side))
      return Observation{side.head<2>(), share, true};
    if (top.y() <= -away_m && top.y() >= -away_m - kThick_m && isBeside(top))
      return Observation{top.head<2>(), share, true};
    const double behind_m = -away_m - kThick_m - floor->y();
    const bool is_behind = behind_m > 0.0 && floor->x() >= kFrom_m && floor->x() <= kTo_m;
    return Observation{*floor, is_behind ? 1.0 - 0.08 * std::exp(-behind_m / 0.2) : 1.0, false};
  }

  /// @param high_m height of the wall; 0: no wall
  cv::Mat3b room(double away_m, double high_m, double share) const {
    cv::Mat3b image(model_.image_height_px, model_.image_width_px, cv::Vec3b(0, 0, 0));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const auto seen = observe(x, y, away_m, high_m, share);
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
  /// Distance up to which floor is certain, metres, towards a point of the wall (its x).
  double sureUpTo(const GroundSegmenter& segmenter, double away_m, double wall_x_m) const {
    const double bearing = std::atan2(-away_m, wall_x_m);
    for (double r = 0.4; r < 2.5; r += 0.01) {
      const auto pixel = camera_.pixelFromPoint({r * std::cos(bearing), r * std::sin(bearing), 0.0});
      const cv::Point at(cvRound(pixel->x()), cvRound(pixel->y()));
      if (segmenter.objects()(at) != 0) return r;
      for (const auto* doubtful : {&segmenter.undecided(), &segmenter.boards(), &segmenter.intensityEdges()})
        if (isIn(*doubtful, at)) return r;
    }
    return std::numeric_limits<double>::infinity();
  }
  /// Share of the wall's length where the floor is certain up to the wall's foot, or up to an object before
  /// it.
  double reportedShare(const GroundSegmenter& segmenter, double away_m,
                       double least = 1.0 - kTolerance) const {
    int reported = 0, all = 0;
    for (double x = kFrom_m + 0.1; x < kTo_m - 0.1; x += 0.05) {
      const double foot_m = std::hypot(x, away_m), sure_m = sureUpTo(segmenter, away_m, x);
      reported += sure_m > least * foot_m && sure_m < (1.0 + kTolerance) * foot_m ? 1 : 0;
      ++all;
    }
    return 1.0 * reported / all;
  }

  lens::CameraModel model_;
  lens::Camera camera_;
  FloorView view_;
};

TEST_F(UndecidedWallTest, ReportsWallOfNearlyFloorBrightness) {
  for (const double away_m : {0.9, 1.2}) {
    for (const double share : {0.86, 0.89, 1.15}) {
      const cv::Mat3b image = room(away_m, 0.14, share);
      GroundSegmenter segmenter(camera_, view_, {});
      for (unsigned seed = 1; seed <= 3; ++seed) {
        ASSERT_TRUE(segmenter.segment(seen(image, seed)));
        EXPECT_GT(reportedShare(segmenter, away_m), 0.8) << away_m << " m, " << share << ", " << seed;
      }
    }
  }
}

/// As the shadow of an object the wall would be floor.
TEST_F(UndecidedWallTest, ReportsWallBehindObjectsOfOtherColours) {
  constexpr double kAway_m = 0.9;
  cv::Mat3b image = room(kAway_m, 0.2, 0.78);
  std::vector<cv::Point> objects;
  for (const double x : {-0.7, 0.1, 0.9}) {  // tall enough to hide some of the wall
    const auto pixel = camera_.pixelFromPoint({x, -kAway_m + 0.05, 0.0});
    objects.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
    const cv::Vec3b colour = x < 0.0 ? cv::Vec3b(160, 60, 40) : cv::Vec3b(26, 26, 28);
    testing::drawDisc<cv::Vec3b>(image, objects.back().x, objects.back().y, 16, colour);
  }
  GroundSegmenter segmenter(camera_, view_, {});
  for (unsigned seed = 1; seed <= 3; ++seed) {
    ASSERT_TRUE(segmenter.segment(seen(image, seed)));
    EXPECT_GT(reportedShare(segmenter, kAway_m, 0.6), 0.9) << seed;
    for (const cv::Point& object : objects) EXPECT_EQ(segmenter.objects()(object), 255);
  }
}

TEST_F(UndecidedWallTest, ReportsNothingWithoutWalls) {
  cv::Mat3b bare = room(1.0, 0.0, 1.0), line = bare.clone(), blotched = bare.clone(), shadow = bare.clone();
  cv::Mat1f blotches(60, 60);
  cv::randn(blotches, 1.0, 0.03);  // each blotch is 0.15 m wide
  for (int y = 0; y < bare.rows; ++y) {
    for (int x = 0; x < bare.cols; ++x) {
      const auto floor = camera_.floorFromPixel({1.0 * x, 1.0 * y});
      if (!floor || floor->norm() > 4.0) continue;
      if (std::abs(floor->y() + 1.0) < 0.015) line(y, x) *= 0.6;
      const cv::Point2d at((floor->x() + 4.5) / 0.15, (floor->y() + 4.5) / 0.15);
      cv::Mat1f share;
      cv::getRectSubPix(blotches, {1, 1}, cv::Point2f(at), share);
      blotched(y, x) *= share(0, 0);
      // The shadow that an object casts under a lamp, with its penumbra.
      const double across_m = std::abs(floor->x() - 0.3) - 0.12, along_m = -0.6 - floor->y();
      const double inside =
          1.0 / (1.0 + std::exp(std::max(across_m, std::max(-along_m, along_m - 0.5)) / 0.02));
      shadow(y, x) *= 1.0 - 0.3 * inside;
    }
  }
  const auto object = camera_.pixelFromPoint({0.3, -0.6, 0.0});
  testing::drawDisc<cv::Vec3b>(shadow, object->x(), object->y(), 18, {30, 30, 190});
  int which = 0;
  for (const cv::Mat3b& image : {bare, line, blotched, shadow}) {
    GroundSegmenter segmenter(camera_, view_, {});
    for (unsigned seed = 1; seed <= 3; ++seed) {
      ASSERT_TRUE(segmenter.segment(seen(image, seed)));
      for (const auto* doubtful : {&segmenter.undecided(), &segmenter.boards(), &segmenter.intensityEdges(),
                                   &segmenter.coarseTexture()})
        EXPECT_TRUE(doubtful->empty()) << which << " " << seed;
    }
    ++which;
  }
}

}  // namespace
}  // namespace omnifleet::ground
