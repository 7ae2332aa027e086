// The foot of a wall whose colour is nearly that of the floor, from whole columns.

#include "distance_vector/floor_split.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "distance_vector/column_view.h"
#include "tests/unit/distance_vector/ray_caster.h"

namespace omnifleet::distance_vector {
namespace {

constexpr int kFoot = 150, kColumn = 160;

class FloorSplitTest : public testing::Test {
 protected:
  /// @param colour of each row @param noise σ of a pixel, grey levels
  template <class Colour>
  static SmoothedImage image(const Colour& colour, double noise = 2.0) {
    cv::Mat bgr(240, 320, CV_8UC3), deviations(240, 320, CV_16SC3);
    for (int v = 0; v < bgr.rows; ++v) bgr.row(v).setTo(colour(v));
    cv::RNG random(7);
    random.fill(deviations, cv::RNG::NORMAL, 0.0, noise);
    cv::add(bgr, deviations, bgr, cv::noArray(), CV_8U);
    SmoothedImage smoothed;
    smoothed.compute(bgr);
    return smoothed;
  }
  std::optional<int> find(const SmoothedImage& smoothed, const std::optional<cv::Vec3f>& known) {
    FloorSample floor;
    floor.direction = cv::normalize(floor_);
    floor.level = static_cast<float>(cv::norm(floor_));
    floor.across = 0.7f;
    split_.begin(floor, known ? std::optional<cv::Vec3f>(cv::normalize(*known)) : std::nullopt);
    return split_.find(smoothed, kColumn);
  }
  std::optional<int> find(const SmoothedImage& smoothed) { return find(smoothed, floor_); }

  const cv::Vec3f floor_{150.0f, 160.0f, 165.0f}, wall_{154.0f, 158.0f, 160.0f};  // 5.5 levels across
  lens::Camera camera_{test::forwardCamera()};
  ColumnView view_{camera_, Options{}};
  FloorSplit split_{view_, WalkOptions{}};
};

cv::Scalar mixed(const cv::Vec3f& a, const cv::Vec3f& b, double share) {
  return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])};
}

TEST_F(FloorSplitTest, FindsTheFootOfAWallThatLooksLikeTheFloor) {
  const auto row = find(image([&](int v) { return mixed(floor_, wall_, v <= kFoot ? 1.0 : 0.0); }));
  ASSERT_TRUE(row);
  EXPECT_NEAR(*row, kFoot, 2);
}

TEST_F(FloorSplitTest, FindsNothingInOneColour) {
  EXPECT_FALSE(find(image([&](int) { return mixed(floor_, wall_, 0.0); })));
}

// A shadow on the floor, or a wall of the floor's own hue: no row says for certain where the floor ends.
TEST_F(FloorSplitTest, FindsNothingInAStepOfBrightness) {
  EXPECT_FALSE(find(image([&](int v) { return mixed(floor_, {}, v <= kFoot ? 0.3 : 0.0); })));
}

TEST_F(FloorSplitTest, FindsNothingInAColourThatDriftsEvenly) {
  EXPECT_FALSE(find(image([&](int v) { return mixed(floor_, wall_, (240.0 - v) / 180.0); })));
}

// Sky: it brightens towards the horizon, in a curve. Nothing is known of a floor.
TEST_F(FloorSplitTest, FindsNothingInACurvedDriftIfNoFloorIsKnown) {
  for (const double power : {1.5, 2.0, 3.0}) {
    const auto seen =
        image([&](int v) { return mixed(floor_, wall_, 2.0 * std::pow((240.0 - v) / 240.0, power)); });
    EXPECT_FALSE(find(seen, std::nullopt)) << power;
  }
}

TEST_F(FloorSplitTest, FindsAStepAlsoIfNoFloorIsKnown) {
  const auto row =
      find(image([&](int v) { return mixed(floor_, wall_, v <= kFoot ? 1.0 : 0.0); }), std::nullopt);
  ASSERT_TRUE(row);
  EXPECT_NEAR(*row, kFoot, 2);
}

// A robot at a wall with a painted base: what the bottom of the image shows is not the floor.
TEST_F(FloorSplitTest, FindsNothingIfThePartAboveLooksMoreLikeTheKnownFloor) {
  const auto seen = image([&](int v) { return mixed(floor_, wall_, v <= kFoot ? 1.0 : 0.0); });
  EXPECT_FALSE(find(seen, wall_));
}

}  // namespace
}  // namespace omnifleet::distance_vector
