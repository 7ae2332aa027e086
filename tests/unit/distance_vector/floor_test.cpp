// Which pixels count as floor.

#include <gtest/gtest.h>

#include "tests/unit/distance_vector/measure.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;

class DistanceVectorFloor : public testing::Test {
 protected:
  /// A wall at 0.8 m; the row of its foot in the middle column.
  DistanceVectorFloor() {
    world_.blocks.push_back({{0.04 + 0.85, 0.0}, {0.05, 3.0}, 0.0, 0.4, {60, 60, 170}});
  }
  double foot() const { return camera_.pixelFromPoint({0.84, 0.0, 0.0})->y(); }
  float middleEdge() {
    vector_.process(caster_.render(world_, {}));
    return vector_.edgeRows()[160];
  }

  World world_;
  lens::Camera camera_{forwardCamera()};
  RayCaster caster_{camera_};
  DistanceVector vector_{camera_, {}};
};

TEST_F(DistanceVectorFloor, EndsAtTheFootOfAWall) {
  EXPECT_NEAR(middleEdge(), foot(), 0.3);
  const cv::Mat& mask = vector_.floorMask();
  EXPECT_EQ(mask.at<std::uint8_t>(static_cast<int>(foot()) + 5, 160), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(static_cast<int>(foot()) - 5, 160), 0);
}

// A dark disc with floor behind it is a shadow or a low object: no hit and no free ray there.
TEST_F(DistanceVectorFloor, LeavesAShadowBeforeFloorUndecided) {
  world_.spots.push_back({{0.4, 0.0}, 0.08, {0.65f, 0.65f, 0.65f}});
  middleEdge();
  EXPECT_EQ(vector_.columnEnds()[160].end, distance_vector::End::kUndecided);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kInvalid);
  EXPECT_EQ(vector_.columnEnds()[20].end, distance_vector::End::kEdge);
}

// The shadow reaches the wall, which differs in hue: the wall ends the floor.
TEST_F(DistanceVectorFloor, FollowsAShadowToTheObjectBehindIt) {
  world_.spots.push_back({{0.75, 0.0}, 0.25, {0.6f, 0.6f, 0.6f}});
  EXPECT_NEAR(middleEdge(), foot(), 0.5);
}

// From near, a card may be a low object: the floor is free up to it, and nothing is known of it.
TEST_F(DistanceVectorFloor, IsUndecidedAtACardFromNear) {
  world_.blocks.clear();
  world_.spots.push_back({{0.4, 0.0}, 0.08, {0.5f, 0.8f, 1.3f}});
  EXPECT_NEAR(middleEdge(), camera_.pixelFromPoint({0.32, 0.0, 0.0})->y(), 0.7);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kUndecided);
  EXPECT_EQ(vector_.boundary().inverse_m[0], 0.0f);
}

// The wall behind the card is seen, but the floor before it is not all free.
TEST_F(DistanceVectorFloor, SeesAWallBehindACard) {
  world_.spots.push_back({{0.4, 0.0}, 0.08, {0.5f, 0.8f, 1.3f}});
  EXPECT_NEAR(middleEdge(), foot(), 0.5);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kBeyond);
}

// From afar, the floor behind it shows that it is lower than 1 cm.
// Between both, the floor lies in the shadow of the wall: no pixel has the colour of the floor.
TEST_F(DistanceVectorFloor, SeesAWallBehindACardAndItsOwnShadow) {
  world_.spots.push_back({{0.4, 0.0}, 0.08, {0.5f, 0.8f, 1.3f}});
  world_.spots.push_back({{0.75, 0.0}, 0.27, {0.6f, 0.6f, 0.6f}});
  EXPECT_NEAR(middleEdge(), foot(), 0.7);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kBeyond);
}

TEST_F(DistanceVectorFloor, CrossesACardFromAfar) {
  world_.blocks[0].centre_m.x() += 0.6;
  world_.spots.push_back({{1.0, 0.0}, 0.04, {0.5f, 0.8f, 1.3f}});
  EXPECT_NEAR(middleEdge(), camera_.pixelFromPoint({1.44, 0.0, 0.0})->y(), 0.4);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kObstacle);
}

// A block of 5 cm hides more than a sheet of paper would.
TEST_F(DistanceVectorFloor, EndsAtALowBlockFromAfar) {
  world_.blocks[0].centre_m.x() = 4.0;
  world_.blocks.push_back({{0.74, 0.0}, {0.04, 0.2}, 0.0, 0.05, {60, 60, 170}});
  EXPECT_NEAR(middleEdge(), camera_.pixelFromPoint({0.7, 0.0, 0.0})->y(), 0.4);
  EXPECT_EQ(vector_.scan().label[0], RayLabel::kObstacle);
}

// A black block on grey floor has no hue, but no shadow is as dark.
TEST_F(DistanceVectorFloor, FollowsAShadowToABlackObject) {
  world_.blocks[0].bgr = {35, 35, 36};
  world_.spots.push_back({{0.75, 0.0}, 0.25, {0.6f, 0.6f, 0.6f}});
  EXPECT_NEAR(middleEdge(), foot(), 0.7);
}

// A line that points at the camera has no floor behind it, so the column beside it is measured.
TEST_F(DistanceVectorFloor, CrossesALineOfOneCentimetre) {
  world_.grid_m = 0.3;
  world_.grid_line_m = 0.01;
  world_.grid_factor = 0.4;
  middleEdge();
  EXPECT_NEAR(vector_.edgeRows()[145], foot(), 0.5);
}

TEST_F(DistanceVectorFloor, FollowsLightThatFallsOff) {
  world_.light_per_m = {-0.6, 0.3};
  EXPECT_NEAR(middleEdge(), foot(), 0.5);
}

// Without walls the floor ends at the horizon: free rays up to the farthest row that is measured.
TEST_F(DistanceVectorFloor, ReachesTheEndOfTheViewInTheOpen) {
  world_.blocks.clear();
  middleEdge();
  int free = 0;
  for (std::size_t i = 0; i < vector_.scan().label.size(); ++i) {
    EXPECT_NE(vector_.scan().label[i], RayLabel::kObstacle) << i;
    if (vector_.scan().label[i] != RayLabel::kFloorEnd) continue;
    ++free;
    EXPECT_GT(vector_.scan().range_m[i], 2.0f);
    EXPECT_LT(vector_.scan().range_m[i], 6.0f);
  }
  EXPECT_GT(free, 150);
}

// Bands that a shadow explains pixel by pixel: their level is lower than that of the floor, their hue
// deviates by less than a pixel shows, and above them the level is that of the floor again. Only the hue of
// the whole column distinguishes a wall.
class DistanceVectorBands : public DistanceVectorFloor {
 protected:
  static constexpr int kFoot = 150, kTop = 95;  // rows; the horizon is in row 83
  /// @param colour of each row; in the left third a red wall is seen
  template <class Colour>
  void see(const Colour& colour) {
    cv::Mat bgr(240, 320, CV_8UC3), deviations(240, 320, CV_16SC3);
    for (int v = 0; v < bgr.rows; ++v) {
      const cv::Vec3f value = colour(v), aside = redWall(v);
      bgr.row(v).setTo(cv::Scalar(value[0], value[1], value[2]));
      bgr.row(v).colRange(0, 100).setTo(cv::Scalar(aside[0], aside[1], aside[2]));
    }
    cv::RNG random(7);
    random.fill(deviations, cv::RNG::NORMAL, 0.0, 2.0);
    cv::add(bgr, deviations, bgr, cv::noArray(), CV_8U);
    vector_.process(bgr);
  }
  cv::Vec3f redWall(int v) const { return v > 100 ? floor_ : cv::Vec3f(40.0f, 40.0f, 150.0f); }
  /// The floor is known from an image before.
  void SetUp() override {
    see([&](int v) { return redWall(v); });
    ASSERT_EQ(middle().end, distance_vector::End::kEdge);
  }
  const distance_vector::ColumnEnd& middle() const { return vector_.columnEnds()[160]; }

  const cv::Vec3f floor_{148.0f, 158.0f, 165.0f},
      wall_{153.0f, 158.0f, 162.0f};  // same level, 5 levels across
};

TEST_F(DistanceVectorBands, OfAnotherHueAreTheFootOfAWall) {
  see([&](int v) { return v > kFoot ? floor_ : wall_ * (v > kTop ? 0.82f : 1.0f); });
  ASSERT_EQ(middle().end, distance_vector::End::kEdge);
  EXPECT_FALSE(middle().weak);
  EXPECT_NEAR(vector_.edgeRows()[160], kFoot + 0.5f, 1.0f);
}

TEST_F(DistanceVectorBands, OfTheFloorsHueStayUndecided) {
  see([&](int v) { return floor_ * (v > kFoot || v <= kTop ? 1.0f : 0.82f); });
  EXPECT_EQ(middle().end, distance_vector::End::kUndecided);
}

// Light that comes from elsewhere tints a shadow.
TEST_F(DistanceVectorBands, OfAnotherHueStayUndecidedWhereTheFloorsHueFollows) {
  see([&](int v) { return v > kFoot || v <= kTop ? floor_ : wall_ * 0.82f; });
  EXPECT_EQ(middle().end, distance_vector::End::kUndecided);
}

TEST_F(DistanceVectorBands, EndAtTheWallBehindFloorInShadow) {
  constexpr int kShadow = kFoot + 30;
  see([&](int v) {
    return v > kShadow ? floor_ : v > kFoot ? floor_ * 0.82f : wall_ * (v > kTop ? 0.82f : 1.0f);
  });
  ASSERT_EQ(middle().end, distance_vector::End::kEdge);
  EXPECT_TRUE(middle().weak);
  EXPECT_NEAR(middle().row, kFoot, 4);
}

}  // namespace
}  // namespace omnifleet::test
