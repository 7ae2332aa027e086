// The travel over which scans must agree with a pose before a robot is relocalized there.
#include "estimation/relocalizer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

scan::LineScan scanInRoom(const Pose2& pose, std::mt19937& random) {
  scan::LineScan scan;
  scan.fit(scan::testing::furnishedRoom().scan(pose, 0.003, random));
  return scan;
}

/// Four keyframes in the furnished room, and one in another, small room that stands `far_m` away; 0: none.
KeyframeMap mapAround(double far_m, std::mt19937& random) {
  KeyframeMap map{KeyframeOptions{}};
  KeyframeMap::Held held;
  held.covariance = 1e-6 * Eigen::Matrix3d::Identity();
  for (const Pose2& pose :
       {Pose2{0.0, 0.0, 0.0}, Pose2{-1.0, 0.3, 1.0}, Pose2{0.2, -1.2, -0.5}, Pose2{1.2, 0.2, 2.0}})
    map.add(pose, {}, scanInRoom(pose, random), held, {});
  const scan::testing::Scene small{{{{-0.5, -0.4}, {0.9, -0.4}, {-0.5, 0.8}}}};
  scan::LineScan scan;
  scan.fit(small.scan({}, 0.003, random));
  if (far_m > 0) map.add({far_m, 0.0, 0.0}, {}, scan, held, {});
  return map;
}

/// Drives a circle after kidnapping. @return travel until relocalization; infinite: never
double travelUntilFound(double far_m, double reach_m, const RelocalizerOptions& options) {
  std::mt19937 random(3);
  const KeyframeMap map = mapAround(far_m, random);
  Relocalizer relocalizer(options);
  const Pose2 moved{0.06, 0.0, 0.08}, wrong{-1.0, -0.5, 2.0};
  Pose2 truth{0.2, -1.2, 0.0};
  for (int i = 0; i < 60; ++i) {
    ScanAid aid;
    aid.scan = scanInRoom(truth, random);
    aid.has_scan = true;
    const auto found = relocalizer.look(map, aid, wrong, i > 0 ? moved : Pose2{}, map.all(), reach_m, M_PI);
    if (found) {
      EXPECT_LT((found->map_from_base.translation() - truth.translation()).norm(), 0.03);
      return 0.06 * i;
    }
    truth = truth * moved;
  }
  return std::numeric_limits<double>::infinity();
}

TEST(Relocalizer, LargerMapNeedsMoreTravel) {
  RelocalizerOptions options;
  options.confirm_rad = 1e3;  // travel alone counts
  const double step_m = 0.06;
  // The keyframes in the room are 2.7 m apart: 0.5 m of travel. With 20 m to the other one: a tenth of 21 m.
  EXPECT_NEAR(travelUntilFound(0.0, 50.0, options), options.confirm_m, step_m);
  EXPECT_NEAR(travelUntilFound(20.0, 50.0, options), options.confirm_share * 21.0, 1.5 * step_m);
  // No more than the extent of the search counts: 2 · 2 m.
  EXPECT_NEAR(travelUntilFound(20.0, 2.0, options), options.confirm_m, step_m);
  options.confirm_share = 0.0;
  EXPECT_NEAR(travelUntilFound(20.0, 50.0, options), options.confirm_m, step_m);
}

TEST(Relocalizer, LargerMapNeedsMoreTurn) {
  EXPECT_GT(travelUntilFound(20.0, 50.0, {}), travelUntilFound(0.0, 50.0, {}));
}

TEST(Relocalizer, TurnCountsLikeTravel) {
  RelocalizerOptions options;
  options.confirm_m = 100.0;
  options.confirm_share = 0.0;
  // 1 rad is 12.5 of these steps.
  EXPECT_NEAR(travelUntilFound(0.0, 50.0, options), 12.5 * 0.06, 0.06);
}

/// Drives in a room after kidnapping. @return whether it is relocalized among the keyframes of the furnished
/// room
/// @param suggest see Relocalizer::look()
bool isFound(const scan::testing::Scene& room, double reach_m, const RelocalizerOptions& options,
             bool suggested = false) {
  std::mt19937 random(4);
  const KeyframeMap map = mapAround(0.0, random);
  Relocalizer relocalizer(options);
  const Pose2 moved{0.06, 0.0, 0.08}, wrong{-1.0, -0.5, 2.0};
  Pose2 truth{0.2, -1.2, 0.0};
  for (int i = 0; i < 60; ++i) {
    ScanAid aid;
    aid.scan.fit(room.scan(truth, 0.003, random));
    aid.has_scan = true;
    Relocalizer::Suggest suggest;
    if (suggested)
      suggest = [&] {
        return std::vector<Relocalizer::Suggestion>{{truth * Pose2{0.3, -0.2, 0.2}, 1.0, 0.4}};
      };
    if (relocalizer.look(map, aid, wrong, i > 0 ? moved : Pose2{}, map.all(), reach_m, 0.5, suggest))
      return true;
    truth = truth * moved;
  }
  return false;
}

TEST(Relocalizer, SearchesWhereSimilarPlacesSuggest) {
  // The search about the prediction does not reach the robot.
  EXPECT_FALSE(isFound(scan::testing::furnishedRoom(), 0.2, {}));
  EXPECT_TRUE(isFound(scan::testing::furnishedRoom(), 0.2, {}, true));
}

TEST(Relocalizer, FindsTheRobotAgainAfterARejection) {
  std::mt19937 random(3);
  const KeyframeMap map = mapAround(0.0, random);
  Relocalizer relocalizer({});
  const Pose2 moved{0.06, 0.0, 0.08};
  Pose2 truth{0.2, -1.2, 0.0};
  int found = 0;
  for (int i = 0; i < 60 && found < 2; ++i) {
    ScanAid aid;
    aid.scan = scanInRoom(truth, random);
    aid.has_scan = true;
    if (relocalizer.look(map, aid, {}, i > 0 ? moved : Pose2{}, map.all(), 50.0, M_PI)) {
      ++found;
      relocalizer.reject();
      // A rejected hypothesis must be confirmed from the beginning.
      EXPECT_FALSE(relocalizer.look(map, aid, {}, {}, map.all(), 50.0, M_PI).has_value());
    }
    truth = truth * moved;
  }
  EXPECT_EQ(found, 2);
}

}  // namespace
}  // namespace omnifleet::estimation
