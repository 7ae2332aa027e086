// When a new detection continues a deleted track.

#include "tracking/deleted_tracks.h"

#include <gtest/gtest.h>

namespace omnifleet::tracking {
namespace {

constexpr double kGate_m = 0.25, kKeep_s = 15.0;

PrismFilter body(const Eigen::Vector2d& place_m, double radius_m) {
  PrismFilter filter({}, place_m, 0.5);
  filter.assumeBody(radius_m, 0.3, true);
  return filter;
}

TimeNs after(double time_s) {
  return static_cast<TimeNs>(1e9 * time_s);
}

/// A robot last seen at the origin at time zero.
class DeletedTracksTest : public testing::Test {
 protected:
  DeletedTracks deletedTrack(std::uint32_t id, double speed_mps) const {
    TrackState track(id, body(Eigen::Vector2d::Zero(), 0.15));
    track.kind = ObjectKind::kRobot;
    track.last_speed_mps = speed_mps;
    DeletedTracks deleted;
    deleted.add(track);
    return deleted;
  }
};

TEST_F(DeletedTracksTest, FindsStationaryRobotOnlyAtItsPlace) {
  DeletedTracks deleted = deletedTrack(7, 0.0);
  EXPECT_FALSE(deleted.take(body({0.4, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s));
  const auto found = deleted.take(body({0.1, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->id, 7U);
  EXPECT_EQ(found->kind, ObjectKind::kRobot);
  EXPECT_FALSE(deleted.take(body({0.1, 0.0}, 0.15), kGate_m, after(3.0), kKeep_s))
      << "an entry is returned only once";
}

TEST_F(DeletedTracksTest, FindsMovingRobotWithinItsReachBySize) {
  EXPECT_TRUE(deletedTrack(7, 0.2).take(body({1.5, 0.0}, 0.15), kGate_m, after(7.0), kKeep_s));
  EXPECT_FALSE(deletedTrack(7, 0.2).take(body({1.5, 0.0}, 0.10), kGate_m, after(7.0), kKeep_s))
      << "another size";
  EXPECT_FALSE(deletedTrack(7, 0.2).take(body({1.5, 0.0}, 0.15), kGate_m, after(2.0), kKeep_s))
      << "out of reach";
}

TEST_F(DeletedTracksTest, KeepsObstacleForOneMinute) {
  TrackState track(7, body(Eigen::Vector2d::Zero(), 0.15));
  track.kind = ObjectKind::kObstacle;
  for (const double time_s : {59.0, 61.0}) {
    DeletedTracks deleted;
    deleted.add(track);
    EXPECT_EQ(deleted.take(body({0.1, 0.0}, 0.15), kGate_m, after(time_s), kKeep_s).has_value(),
              time_s < 60.0);
  }
}

TEST_F(DeletedTracksTest, OmitsRobotThatPublishesItsPose) {
  TrackState track(7, body(Eigen::Vector2d::Zero(), 0.15));
  track.identity = 0;
  DeletedTracks deleted;
  deleted.add(track);
  EXPECT_FALSE(deleted.take(body({0.1, 0.0}, 0.15), kGate_m, after(1.0), kKeep_s));
}

TEST_F(DeletedTracksTest, ForgetsRobotAfterKeepTimeAndOnGap) {
  EXPECT_TRUE(deletedTrack(7, 0.0).take(body({0.1, 0.0}, 0.15), kGate_m, after(14.0), kKeep_s));
  EXPECT_FALSE(deletedTrack(7, 0.0).take(body({0.1, 0.0}, 0.15), kGate_m, after(16.0), kKeep_s));
  DeletedTracks deleted = deletedTrack(7, 0.0);
  deleted.forget();
  EXPECT_FALSE(deleted.take(body({0.1, 0.0}, 0.15), kGate_m, after(1.0), kKeep_s));
}

}  // namespace
}  // namespace omnifleet::tracking
