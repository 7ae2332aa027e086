// Objects whose sides look like the floor: only the top face is segmented, and moves with the camera (wrong
// parallax).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "global_merger/merger.h"
#include "merger_scenes.h"
#include "outline/half_planes.h"

namespace omnifleet::global_merger {
namespace {

using omnifleet::testing::boxPolygon;
using omnifleet::testing::SimRobot;
using namespace testing;  // NOLINT

/// A robot drives past a sixth object, of which it sees only the top face.
class SixthTopFace : public ::testing::Test {
 protected:
  SixthTopFace() {
    obstacles_.push_back({boxPolygon({-1.05, 0.5}, 0.2, 0.2, 0.2), 0.15});
    sets_ = observe(obstacles_);
    for (auto& c : sets_.contributions) {
      const double scale = scaleOf(c);
      for (auto& view : c.views) {
        if (!isSixth(view.track_id)) continue;
        for (auto& b_dmm : view.b_dmm)
          if (b_dmm < 0) b_dmm = static_cast<std::int32_t>(std::lround(b_dmm * scale));
      }
      for (std::size_t ray = 0; ray < c.object.size(); ++ray)
        if (isSixth(c.object[ray]))
          c.range_dmm[ray] = static_cast<std::int32_t>(std::lround(c.range_dmm[ray] * scale));
    }
  }
  static Sets observe(const std::vector<SimObstacle>& obstacles) {
    const SimRobot robot{"r1", [](double t) { return Pose2{0.4 - 0.25 * t, 0.1 - 0.02 * t, 3.0}; }};
    FleetSim sim(obstacles, {robot}, noisy(), 1022);
    return record(sim, 0.0, 8.0, 0.25);
  }
  double scaleOf(const occupancy::Contribution& c) const {
    return c.camera_height_dmm / (c.camera_height_dmm - 1e4 * obstacles_.back().height_m);
  }
  bool isSixth(std::uint32_t track) const { return track == obstacles_.size(); }
  Merger finished(const Sets& sets) const {
    Merger merger = merged(sets, {});
    merger.finish();
    return merger;
  }
  Eigen::Vector2d place() const { return centroid(obstacles_.back().footprint_m); }

  std::vector<SimObstacle> obstacles_ = fiveObstacles();
  Sets sets_;
};

TEST_F(SixthTopFace, IsMappedAtEndAndListedAsLowContrast) {
  Merger merger = merged(sets_, {});
  EXPECT_EQ(score(merger.outlines(), obstacles_).matched, 5);
  merger.finish();
  const Score scored = score(merger.outlines(), obstacles_);
  EXPECT_EQ(scored.matched, 6);
  EXPECT_EQ(scored.extra, 0);
  const auto top = std::find_if(merger.outlines().begin(), merger.outlines().end(), [&](const auto& object) {
    return (object.centroid_m - place()).norm() < 0.15;
  });
  ASSERT_NE(top, merger.outlines().end());
  EXPECT_LT((top->centroid_m - place()).norm(), 0.02);
  EXPECT_NEAR(top->height_m, obstacles_.back().height_m, 0.02);
  EXPECT_GT(outline::convexIou(top->outline_m, obstacles_.back().footprint_m), 0.8);
  ASSERT_EQ(flagged(merger, Quality::kLowContrast).size(), 1U) << "the floor is seen at its place";
  EXPECT_LT((flagged(merger, Quality::kLowContrast)[0] - place()).norm(), 0.02);
  EXPECT_TRUE(merger.rejected().empty());
}

TEST_F(SixthTopFace, IsRemovedIfFloorIsSeenOftenLater) {
  const Sets without = observe(fiveObstacles());
  for (std::size_t i = 0; i < sets_.contributions.size(); ++i)
    if (sets_.contributions[i].acquired_ns >= 4000000000) sets_.contributions[i] = without.contributions[i];
  const std::size_t with = sets_.contributions.size();
  for (int round = 1; round < 8; ++round) {
    for (std::size_t i = 0; i < without.contributions.size(); ++i) {
      occupancy::Contribution c = without.contributions[i];
      occupancy::KeyframePose pose = without.poses[i];
      c.acquired_ns = pose.acquired_ns += round * 10000000000;
      sets_.contributions.push_back(c);
      sets_.poses.push_back(pose);
    }
  }
  ASSERT_GT(sets_.contributions.size(), with);
  Merger merger = finished(sets_);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
  EXPECT_TRUE(flagged(merger, Quality::kLowContrast).empty());
}

TEST_F(SixthTopFace, IsNotMappedWhereARobotDrove) {
  Merger merger = merged(sets_, {});
  PoseEstimate pose;
  pose.robot = "r2";
  pose.acquired_ns = 1000000000;
  pose.valid = true;
  pose.map_from_base = {place().x(), place().y() + 0.02, 0.0};
  merger.addTrajectory(pose);
  merger.finish();
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
}

TEST_F(SixthTopFace, IsNotMappedFromFewViews) {
  int views = 0;
  for (auto& c : sets_.contributions) {
    const auto goes = [&](const auto& view) { return isSixth(view.track_id) && ++views > 11; };
    c.views.erase(std::remove_if(c.views.begin(), c.views.end(), goes), c.views.end());
  }
  ASSERT_GT(views, 11);
  Merger merger = finished(sets_);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
}

}  // namespace
}  // namespace omnifleet::global_merger
