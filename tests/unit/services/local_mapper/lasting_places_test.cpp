#include "local_mapper/lasting_places.h"

#include <gtest/gtest.h>

namespace omnifleet::local_mapper {
namespace {

const std::vector<Eigen::Vector2d> kNone;
const std::vector<ObjectObservation> kNoObjects;

Motion ahead(double x_m, double theta_rad) {
  Motion motion;
  motion.valid = true;
  motion.previous_from_current = {x_m, 0.0, theta_rad};
  return motion;
}

TEST(LastingPlaces, WhatLastsIsToldOnceWhereverTheRobotDrivesAndTurns) {
  LastingPlaces places;
  const Eigen::Vector2d in_map(2.0, 0.5);
  Pose2 map_from_base;
  int told = 0;
  for (int i = 0; i < 3 * LastingPlaces::kLasting; ++i) {
    const Motion motion = ahead(0.05, 0.03);
    if (i > 0) map_from_base = map_from_base * motion.previous_from_current;
    const Eigen::Vector2d at = map_from_base.inverse() * in_map;
    places.take(i > 0 ? motion : Motion{}, {at}, kNoObjects);
    for (const Eigen::Vector2d& place : places.toTell()) {
      EXPECT_EQ(i + 1, LastingPlaces::kLasting);
      EXPECT_NEAR((place - at).norm(), 0.0, 1e-9);
      ++told;
    }
  }
  EXPECT_EQ(told, 1);
  EXPECT_TRUE(places.toTell(true).empty());
}

TEST(LastingPlaces, TwoPlacesAreTwoAndAllOfThemToldThoughTheyFlicker) {
  LastingPlaces places;
  std::size_t told = 0;
  for (int i = 0; i < 2 * LastingPlaces::kLasting; ++i) {
    if (i % 2 == 0)
      places.take({}, {{1.0, 0.0}, {1.0, 0.05}, {0.0, 1.2}}, kNoObjects);
    else
      places.take({}, kNone, kNoObjects);
    told += places.toTell().size();
  }
  EXPECT_EQ(told, 2U);
}

/// Five frames are a whole recording.
TEST(LastingPlaces, AtTheEndHalfOfTheFramesAreEnoughButNotTwo) {
  for (const int seen : {1, 2, 3, 5}) {
    LastingPlaces places;
    for (int i = 0; i < 5; ++i)
      places.take({}, i < seen ? std::vector<Eigen::Vector2d>{{1.0, 0.0}} : kNone, kNoObjects);
    EXPECT_TRUE(places.toTell().empty());
    EXPECT_EQ(places.toTell(true).size(), seen >= 3 ? 1U : 0U) << seen;
  }
  LastingPlaces places;
  for (int i = 0; i < 8; ++i)
    places.take({}, i < 3 ? std::vector<Eigen::Vector2d>{{1.0, 0.0}} : kNone, kNoObjects);
  EXPECT_TRUE(places.toTell(true).empty()) << "mostly not there";
}

TEST(LastingPlaces, WhatTurnsOutToBeAThingIsDecided) {
  LastingPlaces places;
  ObjectObservation object;
  object.hull_m = {{0.9, -0.2}, {1.3, -0.2}, {1.3, 0.2}, {0.9, 0.2}};
  object.contact_m = {0.9, -0.2};
  for (int i = 0; i < 5; ++i) places.take({}, {{1.1, 0.1}, {0.0, 1.2}}, kNoObjects);
  for (int i = 0; i < 4; ++i) places.take({}, {{0.0, 1.2}}, {object});
  LastingPlaces seldom = places;
  EXPECT_EQ(seldom.toTell(true).size(), 2U) << "not as long as it is mostly undecided";
  places.take({}, {{0.0, 1.2}}, {object});
  const auto& told = places.toTell(true);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NEAR((told[0] - Eigen::Vector2d(0.0, 1.2)).norm(), 0.0, 1e-9);
}

}  // namespace
}  // namespace omnifleet::local_mapper
