#include "motion/narrowing.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kDt = 0.2;
const Slot kLeft{0, 0.8, -0.6};  // the followed robot is seen to the right

/// A trail along a circle of radius 2 m. It ends at the robot, which is at the origin and heads along x.
Trail circle(double length_m) {
  Trail trail;
  for (double s = length_m; s >= 0.0; s -= 0.05)
    trail.add({-2.0 * std::sin(0.5 * s), 2.0 - 2.0 * std::cos(0.5 * s)});
  return trail;
}

TEST(Trail, ReturnsSpotsOnThePathDriven) {
  const Trail trail = circle(3.0);
  EXPECT_NEAR(trail.length_m(), 3.0, 0.06);
  for (const double back_m : {0.0, 0.4, 1.3, 2.5}) {
    const Trail::Spot spot = trail.at(back_m, 0.0);
    const Eigen::Vector2d exact(-2.0 * std::sin(0.5 * back_m), 2.0 - 2.0 * std::cos(0.5 * back_m));
    EXPECT_LT((spot.place_m - exact).norm(), 1e-3)
        << back_m;  // chords of 5 cm deviate 0.2 mm from the circle
    EXPECT_NEAR(std::atan2(spot.ahead.y(), spot.ahead.x()), -0.5 * back_m, 0.02);
  }
}

TEST(Trail, MovesWithTheObserver) {
  Trail trail = circle(3.0);
  const Eigen::Vector2d before = trail.at(1.0, 0.0).place_m;
  const Pose2 step{0.1, -0.05, 0.3};
  trail.moved(step);
  EXPECT_LT((step * trail.at(1.0, 0.0).place_m - before).norm(), 1e-9);
}

TEST(Trail, ExtrapolatesStraightBeyondItsEnd) {
  Trail trail;
  EXPECT_LT((trail.at(1.0, 0.0).place_m).norm(), 1e-12);
  trail.add({0.0, 0.0});
  EXPECT_LT((trail.at(1.0, 0.5 * M_PI).place_m - Eigen::Vector2d(0.0, -1.0)).norm(), 1e-12);
  trail.add({0.5, 0.0});
  EXPECT_LT((trail.at(1.0, 0.0).place_m - Eigen::Vector2d(-0.5, 0.0)).norm(), 1e-12);
}

class NarrowingTest : public testing::Test {
 protected:
  NarrowingTest() {
    around_.radius_m = 0.15;
    for (double x = -2.0; x <= 0.0; x += 0.05) trail_.add(followed_.position_m + Eigen::Vector2d(x, 0.0));
  }
  double settle(const Slot& slot, std::size_t rank, int frames = 20) {
    for (int i = 0; i < frames; ++i) narrowing_.update(slot, rank, followed_, trail_, around_, kDt);
    return narrowing_.narrowing();
  }
  Eigen::Vector2d place(const Slot& slot, std::size_t rank) const {
    return narrowing_.place(slot, rank, followed_, trail_, law_).position_m;
  }
  const FollowLaw law_{FollowLaw::Options{}};
  Narrowing::Options options_;
  Narrowing narrowing_{options_};
  Followed followed_{{0.8 * std::cos(0.6), -0.8 * std::sin(0.6)}, 0.0, {0.25, 0.0}, true};
  Trail trail_;
  Surroundings around_;
};

TEST_F(NarrowingTest, KeepsCommandedPlaceWhereThereIsRoom) {
  around_.points_m = {{0.5, 0.6}};
  EXPECT_EQ(settle(kLeft, 1), 0.0);
  EXPECT_LT(place(kLeft, 1).norm(), 1e-12);
}

TEST_F(NarrowingTest, NarrowsOnlyAsFarAsAWallRequires) {
  // A wall on the left, 20 cm from the commanded place; 15 + 16 cm are required.
  for (double x = -1.0; x < 2.0; x += 0.05) around_.points_m.emplace_back(x, 0.2);
  const double narrowing = settle(kLeft, 1);
  EXPECT_GT(narrowing, 0.0);
  EXPECT_LT(narrowing, 0.5);
  const double free_m = 0.2 - place(kLeft, 1).y();
  EXPECT_GE(free_m, around_.radius_m + options_.margin_m - 1e-9);
  // Tolerance: one step of the search (a tenth of the full narrowing, here 4.5 cm) and the hysteresis.
  EXPECT_LE(free_m, around_.radius_m + options_.margin_m + options_.settle_m + 0.05);
}

TEST_F(NarrowingTest, QueuesBothSidesOnTheTrailInADoorway) {
  for (const double side : {0.35, -0.35}) {
    for (double x = -1.0; x < 2.0; x += 0.05)
      around_.points_m.emplace_back(x, followed_.position_m.y() + side);
  }
  const Slot right{0, 0.8, 0.6};
  EXPECT_GT(settle(kLeft, 1), 0.8);
  const Eigen::Vector2d first = place(kLeft, 1);
  Narrowing other(options_);
  for (int i = 0; i < 20; ++i) other.update(right, 2, followed_, trail_, around_, kDt);
  const Eigen::Vector2d second = other.place(right, 2, followed_, trail_, law_).position_m;
  EXPECT_LT(std::abs(first.y() - followed_.position_m.y()), 0.09);
  EXPECT_LT(std::abs(second.y() - followed_.position_m.y()), 0.09);
  EXPECT_GT((first - second).norm(), 0.45) << "two bodies of 30 cm must queue one behind the other";
}

TEST_F(NarrowingTest, IgnoresObstaclesBeyondTheGoal) {
  around_.points_m = {{0.58, 0.0}};  // 43 cm ahead of the body at the commanded place
  Narrowing going(options_);
  for (int i = 0; i < 20; ++i) going.update(kLeft, 1, followed_, trail_, around_, kDt);
  EXPECT_GT(going.narrowing(), 0.3) << "the path goes on: the place will reach the obstacle soon";
  for (const double remaining_m : {0.0, 0.25}) {
    followed_.remaining_m = remaining_m;
    EXPECT_EQ(settle(kLeft, 1), 0.0) << remaining_m;
  }
  // The end of the path counts: 15 + 16 cm are required there, also if no sample of the path ahead falls on
  // it.
  followed_.remaining_m = 0.29;
  EXPECT_GT(settle(kLeft, 1), 0.0);
  // A follower that has already narrowed stays so: obstacles hide from its camera whether there is room
  // behind.
  const double narrowed = going.narrowing();
  followed_.remaining_m = 0.0;
  for (int i = 0; i < 20; ++i) going.update(kLeft, 1, followed_, trail_, around_, kDt);
  EXPECT_GE(going.narrowing(), narrowed);
}

TEST_F(NarrowingTest, KeepsBothSidesApartWhileNarrowing) {
  // Two bodies of 30 cm stay apart at every combination of narrowings.
  const Slot right{0, 0.8, 0.6};
  around_.points_m = {followed_.position_m, place(kLeft, 1)};  // no place is free: both sides narrow
  Narrowing::Options slow = options_;
  slow.in_per_s = 0.5;
  for (int left_head_start = 0; left_head_start < 10; ++left_head_start) {
    Narrowing left_one(slow), right_one(slow);
    for (int i = 0; i < 20; ++i) {
      left_one.update(kLeft, 1, followed_, trail_, around_, kDt);
      if (i >= left_head_start) right_one.update(right, 2, followed_, trail_, around_, kDt);
      const double apart_m = (left_one.place(kLeft, 1, followed_, trail_, law_).position_m -
                              right_one.place(right, 2, followed_, trail_, law_).position_m)
                                 .norm();
      EXPECT_GT(apart_m, 0.40) << left_head_start << " " << i;
    }
  }
}

TEST_F(NarrowingTest, SpreadsOutAtTheConfiguredRate) {
  around_.points_m = {{0.0, 0.0}};
  const double narrowed = settle(kLeft, 1);
  EXPECT_GT(narrowed, 0.3);
  around_.points_m.clear();
  EXPECT_NEAR(settle(kLeft, 1, 1), narrowed - options_.out_per_s * kDt, 1e-12);
  EXPECT_EQ(settle(kLeft, 1, 30), 0.0);
}

TEST_F(NarrowingTest, PlacesColumnOnTheTrailWithoutObstacles) {
  const Slot behind{0, 0.8, 0.0};
  EXPECT_EQ(settle(behind, 1, 1), 1.0);
  Narrowing column(options_);
  followed_.position_m = {0.0, 0.0};
  const Trail curve = circle(3.0);
  column.update(behind, 1, followed_, curve, around_, kDt);
  const Eigen::Vector2d place_m = column.place(behind, 1, followed_, curve, law_).position_m;
  EXPECT_LT((place_m - Eigen::Vector2d(-2.0 * std::sin(0.4), 2.0 - 2.0 * std::cos(0.4))).norm(), 1e-3);
}

TEST(NarrowingOptions, RejectsInvalidOptions) {
  const auto read = [](const std::string& text) {
    return Narrowing::Options::read(options::Section::parse(text, "t"));
  };
  EXPECT_FALSE(read("enabled: false").enabled);
  EXPECT_THROW(read("margin_m: -0.1"), options::Error);
  EXPECT_THROW(read("margin: 0.1"), options::Error);
}

}  // namespace
}  // namespace omnifleet::motion
