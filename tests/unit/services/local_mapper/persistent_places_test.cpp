#include "local_mapper/persistent_places.h"

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

TEST(PersistentPlaces, ReportsPersistentPlaceOnceWhileRobotMoves) {
  PersistentPlaces places;
  const Eigen::Vector2d in_map(2.0, 0.5);
  Pose2 map_from_base;
  int reported = 0;
  for (int i = 0; i < 3 * PersistentPlaces::kPersistent; ++i) {
    const Motion motion = ahead(0.05, 0.03);
    if (i > 0) map_from_base = map_from_base * motion.previous_from_current;
    const Eigen::Vector2d at = map_from_base.inverse() * in_map;
    places.take(i > 0 ? motion : Motion{}, {at}, kNoObjects);
    for (const Eigen::Vector2d& place : places.toReport()) {
      EXPECT_EQ(i + 1, PersistentPlaces::kPersistent);
      EXPECT_NEAR((place - at).norm(), 0.0, 1e-9);
      ++reported;
    }
  }
  EXPECT_EQ(reported, 1);
  EXPECT_TRUE(places.toReport(true).empty());
}

TEST(PersistentPlaces, ReportsEachOfTwoFlickeringPlaces) {
  PersistentPlaces places;
  std::size_t reported = 0;
  for (int i = 0; i < 2 * PersistentPlaces::kPersistent; ++i) {
    if (i % 2 == 0)
      places.take({}, {{1.0, 0.0}, {1.0, 0.05}, {0.0, 1.2}}, kNoObjects);
    else
      places.take({}, kNone, kNoObjects);
    reported += places.toReport().size();
  }
  EXPECT_EQ(reported, 2U);
}

/// A recording may consist of only five frames.
TEST(PersistentPlaces, ReportsPlacesSeenInHalfOfTheFramesAtTheEnd) {
  for (const int seen : {1, 2, 3, 5}) {
    PersistentPlaces places;
    for (int i = 0; i < 5; ++i)
      places.take({}, i < seen ? std::vector<Eigen::Vector2d>{{1.0, 0.0}} : kNone, kNoObjects);
    EXPECT_TRUE(places.toReport().empty());
    EXPECT_EQ(places.toReport(true).size(), seen >= 3 ? 1U : 0U) << seen;
  }
  PersistentPlaces places;
  for (int i = 0; i < 8; ++i)
    places.take({}, i < 3 ? std::vector<Eigen::Vector2d>{{1.0, 0.0}} : kNone, kNoObjects);
  EXPECT_TRUE(places.toReport(true).empty()) << "seen in less than half of the frames";
}

TEST(PersistentPlaces, DropsPlaceThatTurnsOutToBeAnObject) {
  PersistentPlaces places;
  ObjectObservation object;
  object.hull_m = {{0.9, -0.2}, {1.3, -0.2}, {1.3, 0.2}, {0.9, 0.2}};
  object.contact_m = {0.9, -0.2};
  for (int i = 0; i < 5; ++i) places.take({}, {{1.1, 0.1}, {0.0, 1.2}}, kNoObjects);
  for (int i = 0; i < 4; ++i) places.take({}, {{0.0, 1.2}}, {object});
  PersistentPlaces seldom = places;
  EXPECT_EQ(seldom.toReport(true).size(), 2U) << "kept while it is undecided more often than occupied";
  places.take({}, {{0.0, 1.2}}, {object});
  const auto& reported = places.toReport(true);
  ASSERT_EQ(reported.size(), 1U);
  EXPECT_NEAR((reported[0] - Eigen::Vector2d(0.0, 1.2)).norm(), 0.0, 1e-9);
}

}  // namespace
}  // namespace omnifleet::local_mapper
