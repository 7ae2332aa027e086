// Places by their signatures: the index, the suggested poses, and the check by the compass.
#include "estimation/place_recognition.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "tests/unit/appearance/textured_room.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

Appearance seenIn(unsigned texture, const Pose2& pose) {
  const appearance::PanoramaOptions options;
  appearance::SignatureMaker maker(test::roomUnwrapper(options), {});
  Appearance seen;
  seen.format = maker.format();
  seen.signature = appearance::store(maker.compute(test::TexturedRoom(texture).panorama(pose, options)));
  return seen;
}

Place placeAt(const std::string& robot, unsigned texture, const Pose2& pose, TimeNs time_ns = 0) {
  const Appearance seen = seenIn(texture, pose);
  Place place;
  place.robot = robot;
  place.acquired_ns = time_ns;
  place.frame_from_base = pose;
  place.format = seen.format;
  place.signature = seen.signature;
  return place;
}

const Pose2 kPlaces[] = {{-1.6, -1.0, 0.2}, {0.0, 0.1, 1.4}, {1.5, 0.9, -2.0}};

class PlaceRecognitionTest : public ::testing::Test {
 protected:
  PlaceRecognitionTest() : map_(KeyframeOptions{}) {
    std::mt19937 random(1);
    KeyframeMap::Held held;
    held.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    for (const Pose2& pose : kPlaces) {
      scan::LineScan scan;
      scan.fit(scan::testing::furnishedRoom().scan(pose, 0.003, random));
      const KeyframeMap::Id keyframe = map_.add(pose, {}, scan, held, {});
      memory_.add(placeAt("r1", 5, pose), keyframe, map_, Eigen::Matrix3d::Identity());
    }
    scope_.memories = {&memory_, &other_};
    scope_.keyframes = map_.all();
    scope_.robot = 1;
  }

  KeyframeMap map_;
  PlaceMemory memory_, other_;
  PlaceRecognition recognition_;
  PlaceRecognition::Scope scope_;
};

TEST(PlaceIndex, FindsTheMostSimilarPlace) {
  const KeyframeMap map{KeyframeOptions{}};
  PlaceMemory memory;
  for (const Pose2& pose : kPlaces)
    memory.add(placeAt("r1", 5, pose), std::nullopt, map, Eigen::Matrix3d::Identity());
  PlaceIndex index;
  index.update(0, memory);
  index.update(0, memory);  // nothing is new
  EXPECT_EQ(index.size(), 3u);
  const Appearance seen = seenIn(5, {1.45, 0.85, 0.7});
  const auto found = index.nearest(seen.format, seen.signature, 2);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].place.index, 2u);
  EXPECT_LE(found[0].distance, found[1].distance);
}

TEST(PlaceIndex, ReportsAnotherFormatOnce) {
  const KeyframeMap map{KeyframeOptions{}};
  PlaceMemory memory, other;
  memory.add(placeAt("r1", 5, kPlaces[0]), std::nullopt, map, Eigen::Matrix3d::Identity());
  for (const Pose2& pose : kPlaces) {
    Place place = placeAt("r2", 5, pose);
    place.format.camera = "another lens";
    other.add(place, std::nullopt, map, Eigen::Matrix3d::Identity());
  }
  PlaceIndex index;
  index.update(0, memory);
  EXPECT_TRUE(index.takeRefusals().empty());
  index.update(1, other);
  const auto refusals = index.takeRefusals();
  ASSERT_EQ(refusals.size(), 1u);
  EXPECT_NE(refusals[0].robot.find("r2"), std::string::npos);
  EXPECT_NE(refusals[0].why.find("another lens"), std::string::npos);
  EXPECT_TRUE(index.takeRefusals().empty());
  // Places of one format are not found for signatures of the other.
  const Appearance seen = seenIn(5, kPlaces[0]);
  for (const auto& found : index.nearest(seen.format, seen.signature, 10)) EXPECT_EQ(found.place.robot, 0u);
}

TEST_F(PlaceRecognitionTest, SuggestsThePoseOfAKidnappedRobot) {
  const Pose2 truth{1.35, 0.8, 0.6};  // 0.18 m from the third place
  const auto suggestions = recognition_.suggest(scope_, seenIn(5, truth));
  ASSERT_FALSE(suggestions.empty());
  const Pose2 off = suggestions[0].map_from_base.inverse() * truth;
  EXPECT_LT(off.translation().norm(), suggestions[0].reach_m);
  EXPECT_LT(std::abs(off.theta_rad), suggestions[0].reach_rad);
  EXPECT_LT(suggestions[0].reach_rad, 1.0) << "the compass bounds the heading";
}

TEST_F(PlaceRecognitionTest, SuggestsNothingFromPlacesOutOfScope) {
  scope_.keyframes = {0, 1};
  for (const auto& suggestion : recognition_.suggest(scope_, seenIn(5, kPlaces[2])))
    EXPECT_GT((suggestion.map_from_base.translation() - kPlaces[2].translation()).norm(), 0.5);
  // A robot's own places since something confirmed its pose are wrong, too.
  scope_.keyframes = map_.all();
  scope_.robot = 0;
  scope_.before_ns = -1;
  EXPECT_TRUE(recognition_.suggest(scope_, seenIn(5, kPlaces[2])).empty());
}

TEST_F(PlaceRecognitionTest, FindsTheNearestPlaceInReach) {
  const auto nearest = recognition_.nearest(scope_, {0.2, 0.2, 3.0});
  ASSERT_TRUE(nearest.has_value());
  EXPECT_EQ(nearest->robot, 0u);
  EXPECT_EQ(nearest->index, 1u);
  EXPECT_FALSE(recognition_.nearest(scope_, {9.0, 0.0, 0.0}).has_value());
}

}  // namespace
}  // namespace omnifleet::estimation
