// Frames that have left the window follow the keyframes that they were matched with.
#include "estimation/path_memory.h"

#include <gtest/gtest.h>

namespace omnifleet::estimation {
namespace {

using Id = KeyframeMap::Id;

Eigen::Matrix3d square(double sigma) {
  return sigma * sigma * Eigen::Matrix3d::Identity();
}

/// Keyframes along x, 1 m apart.
KeyframeMap chain(int count) {
  const KeyframeOptions options;
  KeyframeMap map(options);
  for (int k = 0; k < count; ++k) {
    KeyframeMap::Held held;
    held.covariance = square(k == 0 ? 0.001 : 0.1);
    if (k > 0) {
      held.previous = static_cast<Id>(k - 1);
      held.previous_from_this = {1.0, 0.0, 0.0};
    }
    map.add({static_cast<double>(k), 0.0, 0.0}, {}, {}, held, {});
  }
  return map;
}

PoseEstimate frame(TimeNs time, const Pose2& pose) {
  PoseEstimate estimate;
  estimate.robot = "r1";
  estimate.acquired_ns = time;
  estimate.valid = true;
  estimate.map_from_base = pose;
  return estimate;
}

TEST(PathMemory, MovesFramesWithTheirKeyframes) {
  KeyframeMap map = chain(5);
  PathMemory path;
  for (int k = 0; k < 5; ++k)
    path.add(frame(k, {k + 0.3, 0.1, 0.2}), static_cast<Id>(k), map.pose(static_cast<Id>(k)));
  std::vector<PoseEstimate> revised;
  path.follow(map, 0.001, 0.001, revised);
  EXPECT_TRUE(revised.empty());
  // The end of the chain turns out to lie 0.4 m beside.
  map.closeLoop(0, 4, {4.0, 0.4, 0.0}, square(0.001));
  path.follow(map, 0.001, 0.001, revised);
  ASSERT_EQ(revised.size(), 4u);  // all but that at the first keyframe, which has not moved
  for (const PoseEstimate& pose : revised) {
    const auto k = static_cast<Id>(pose.acquired_ns);
    const Pose2 expected = map.pose(k) * Pose2{0.3, 0.1, 0.2};
    EXPECT_LT((expected.inverse() * pose.map_from_base).translation().norm(), 1e-12);
    EXPECT_TRUE(pose.valid);
  }
  EXPECT_NEAR(revised.back().map_from_base.y_m, 0.5, 0.01);
  revised.clear();
  path.follow(map, 0.001, 0.001, revised);
  EXPECT_TRUE(revised.empty());  // published once
}

TEST(PathMemory, TakesOverThePathOfAJoiningRobot) {
  KeyframeMap map = chain(3), own = chain(2);
  PathMemory path, theirs;
  theirs.add(frame(7, {0.2, 0.0, 0.0}), 1, own.pose(1));
  theirs.add(frame(3, {-0.5, 0.0, 0.0}));  // before the first keyframe
  const Pose2 map_from_own{2.0, 1.0, 0.5 * M_PI};
  const Id first = map.append(own, map_from_own, square(0.01));
  std::vector<PoseEstimate> revised;
  path.append(theirs, first, map_from_own, map, revised);
  ASSERT_EQ(revised.size(), 2u);
  EXPECT_EQ(path.size(), 2u);
  for (const PoseEstimate& pose : revised) {
    const Pose2 in_own = pose.acquired_ns == 7 ? Pose2{0.2, 0.0, 0.0} : Pose2{-0.5, 0.0, 0.0};
    EXPECT_LT(((map_from_own * in_own).inverse() * pose.map_from_base).translation().norm(), 1e-9);
  }
  // From now on they follow this map.
  map.closeLoop(0, first + 1, {3.0, 3.0, 0.0}, square(1e-4));
  revised.clear();
  path.follow(map, 0.001, 0.001, revised);
  ASSERT_EQ(revised.size(), 1u);
  EXPECT_EQ(revised.front().acquired_ns, 7);
}

}  // namespace
}  // namespace omnifleet::estimation
