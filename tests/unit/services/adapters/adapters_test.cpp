// Domain types survive the conversion to IDL types and back: every field has its own value. Non-finite
// numbers are rejected in every field.

#include "adapters/adapters.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <vector>

#include "tests/unit/services/adapters/samples.h"

namespace omnifleet::adapters {
namespace {

using test::Counter;
using test::expectEqual;
using test::expectEqualFrames;
using test::kNan;
using test::kNanF;
using test::someFrame;
using test::someObservation;
using test::someTrack;

TEST(Adapters, PreservesLocalMap) {
  Counter n;
  auto map = someFrame<LocalMap>(n);
  map.objects = {someObservation(n)};
  v1::LocalMap wire;
  toWire(map, RunClock::kDataset, wire);
  EXPECT_EQ(wire.header().clock(), v1::Clock::CLOCK_DATASET);
  LocalMap back;
  ASSERT_TRUE(fromWire(wire, back));
  expectEqualFrames(map, back);
  ASSERT_EQ(back.objects.size(), 1u);
  const ObjectObservation &a = map.objects[0], &b = back.objects[0];
  EXPECT_EQ(a.label, b.label);
  EXPECT_EQ(a.rect_x_px, b.rect_x_px);
  EXPECT_EQ(a.rect_y_px, b.rect_y_px);
  EXPECT_EQ(a.rect_width_px, b.rect_width_px);
  EXPECT_EQ(a.rect_height_px, b.rect_height_px);
  EXPECT_EQ(a.hull_m, b.hull_m);
  EXPECT_EQ(a.centroid_m, b.centroid_m);
  EXPECT_EQ(a.contact_m, b.contact_m);
  expectEqual(a.supports, b.supports);
  EXPECT_EQ(a.solidity, b.solidity);
  EXPECT_EQ(a.truncated, b.truncated);
  EXPECT_EQ(a.height_m, b.height_m);
  EXPECT_EQ(a.height_sigma_m, b.height_sigma_m);
  ASSERT_EQ(b.vectors.size(), 1u);
  EXPECT_EQ(a.vectors[0].from_px, b.vectors[0].from_px);
  EXPECT_EQ(a.vectors[0].to_px, b.vectors[0].to_px);
  EXPECT_EQ(a.vectors[0].from_m, b.vectors[0].from_m);
  EXPECT_EQ(a.vectors[0].to_m, b.vectors[0].to_m);
  EXPECT_EQ(a.vectors[0].residual_m, b.vectors[0].residual_m);
  expectEqual(a.vectors[0].point, b.vectors[0].point);
}

TEST(Adapters, PreservesObjects) {
  Counter n;
  auto objects = someFrame<Objects>(n);
  objects.tracks = {someTrack(n), someTrack(n)};
  v1::Objects wire;
  toWire(objects, RunClock::kSim, wire);
  Objects back;
  ASSERT_TRUE(fromWire(wire, back));
  expectEqualFrames(objects, back);
  ASSERT_EQ(back.tracks.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    const Track &a = objects.tracks[i], &b = back.tracks[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.kind_probability, b.kind_probability);
    EXPECT_EQ(a.visible, b.visible);
    EXPECT_EQ(a.position_m, b.position_m);
    EXPECT_EQ(a.velocity_mps, b.velocity_mps);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.contact_m, b.contact_m);
    EXPECT_EQ(a.hull_m, b.hull_m);
    expectEqual(a.supports, b.supports);
    EXPECT_EQ(a.solidity, b.solidity);
    EXPECT_EQ(a.truncated, b.truncated);
    EXPECT_EQ(a.height_m, b.height_m);
    EXPECT_EQ(a.height_sigma_m, b.height_sigma_m);
    ASSERT_EQ(b.points.size(), 2u);
    for (int k = 0; k < 2; ++k) expectEqual(a.points[k], b.points[k]);
  }
}

TEST(Adapters, KeepsUndecidedRaysDownToTheMap) {
  Objects objects;
  objects.robot = "r1";
  objects.scan.range_m = {1.0F};
  objects.scan.sigma_m = {0.01F};
  objects.scan.label = {RayLabel::kUndecided};
  objects.scan.object = {0};
  v1::Objects wire;
  toWire(objects, RunClock::kDataset, wire);
  Objects again;
  ASSERT_TRUE(fromWire(wire, again));
  EXPECT_EQ(again.scan.label.front(), RayLabel::kUndecided);
  v1::Contribution wire_contribution;
  toWire(occupancy::makeContribution(again), RunClock::kDataset, wire_contribution);
  occupancy::Contribution contribution;
  ASSERT_TRUE(fromWire(wire_contribution, contribution));
  EXPECT_EQ(contribution.label.front(), RayLabel::kUndecided);
  EXPECT_EQ(contribution.sigma_dmm, (std::vector<std::uint16_t>{100}));
  wire.scan().label().front() = 7;
  EXPECT_FALSE(fromWire(wire, again)) << "no such label";
}

TEST(Adapters, PreservesPose) {
  Counter n;
  PoseEstimate pose;
  pose.robot = "r2";
  pose.acquired_ns = 5;
  pose.sequence = 6;
  pose.valid = true;
  pose.frame = "r2";
  pose.map_from_base = n.pose();
  pose.covariance = n.matrix<3>();
  pose.sightings = {{9, "r1"}, {10, "r3"}};
  pose.camera_error = {0.001, -0.002, 0.003, -0.004};
  pose.datum = 2;
  pose.used.add(Source::kScan);
  pose.used.add(Source::kInitialPose);
  pose.rejected.add(Source::kWheels);
  v1::Pose wire;
  toWire(pose, RunClock::kSystem, 3, wire);
  EXPECT_EQ(wire.term(), 3u);
  PoseEstimate back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.robot, pose.robot);
  EXPECT_EQ(back.acquired_ns, pose.acquired_ns);
  EXPECT_EQ(back.sequence, pose.sequence);
  EXPECT_EQ(back.valid, pose.valid);
  EXPECT_EQ(back.map_from_base.vector(), pose.map_from_base.vector());
  EXPECT_EQ(back.covariance, pose.covariance);
  EXPECT_EQ(back.camera_error, pose.camera_error);
  EXPECT_EQ(back.datum, 2u);
  EXPECT_EQ(wire.sources_used(), v1::SOURCE_SCAN | v1::SOURCE_INITIAL_POSE);
  EXPECT_EQ(wire.sources_rejected(), v1::SOURCE_WHEELS);
  EXPECT_EQ(back.used, pose.used);
  EXPECT_EQ(back.rejected, pose.rejected);
  EXPECT_EQ(back.frame, "r2");
  ASSERT_EQ(back.sightings.size(), 2u);
  EXPECT_EQ(back.sightings[1].track_id, 10u);
  EXPECT_EQ(back.sightings[1].robot, "r3");
  wire.sources_rejected(256);
  EXPECT_FALSE(fromWire(wire, back)) << "no such source";
  EXPECT_FALSE(back.valid);
  EXPECT_EQ(back.used, SourceSet{});
}

TEST(Adapters, PreservesContributionsExactly) {
  Counter n;
  auto objects = someFrame<Objects>(n);
  objects.state = FrameState::kOk;
  objects.tracks = {someTrack(n)};
  objects.tracks[0].kind = ObjectKind::kObstacle;
  objects.tracks[0].points = {{{0.5f, -1.25f, 0.125f}, 0.02f}, {{0.5f, -1.5f, 0.25f}, 0.01f}};
  const auto contribution = occupancy::makeContribution(objects);
  ASSERT_EQ(contribution.points.size(), 2u);
  v1::Contribution wire;
  toWire(contribution, RunClock::kDataset, wire);
  occupancy::Contribution back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(occupancy::canonicalBytes(back), occupancy::canonicalBytes(contribution));
  EXPECT_GT(occupancy::canonicalBytes(contribution).size(), 100u);

  PoseEstimate pose;
  pose.robot = "r2";
  pose.acquired_ns = 77;
  pose.valid = true;
  pose.map_from_base = n.pose();
  pose.frame = "r2";
  pose.sightings = {{9, "r1"}};
  pose.camera_error = {0.001, -0.002, 0.003, -0.004};
  const auto keyframe = occupancy::makeKeyframePose(pose, 2, 3);
  v1::KeyframePose keyframe_wire;
  toWire(keyframe, RunClock::kDataset, keyframe_wire);
  occupancy::KeyframePose keyframe_back;
  ASSERT_TRUE(fromWire(keyframe_wire, keyframe_back));
  EXPECT_EQ(occupancy::canonicalBytes(keyframe_back), occupancy::canonicalBytes(keyframe));
  EXPECT_EQ(keyframe_back.frame, "r2");
  EXPECT_EQ(keyframe_back.camera_error, (occupancy::CameraErrorPpm{1000, -2000, 3000, -4000}));
}

TEST(Adapters, PreservesStatementsOfReplicas) {
  using namespace occupancy;
  Have have{"r1",
            true,
            {{"r1", SampleKind::kContribution, kEarliest, -5, 3, 0xF123456789ABCDEFULL},
             {"r2", SampleKind::kKeyframePose, 7, kLatest, 0, 0}}};
  v1::Have wire;
  toWire(have, wire);
  Have back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.replica, "r1");
  EXPECT_TRUE(back.ending);
  ASSERT_EQ(back.ranges.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back.ranges[i].robot, have.ranges[i].robot);
    EXPECT_EQ(back.ranges[i].kind, have.ranges[i].kind);
    EXPECT_EQ(back.ranges[i].first_ns, have.ranges[i].first_ns);
    EXPECT_EQ(back.ranges[i].last_ns, have.ranges[i].last_ns);
    EXPECT_EQ(back.ranges[i].count, have.ranges[i].count);
    EXPECT_EQ(back.ranges[i].digest, have.ranges[i].digest);
  }
  wire.ranges()[1].kind(2);
  EXPECT_FALSE(fromWire(wire, back));
  wire.ranges()[1].kind(1);
  wire.ranges()[1].first_ns(8);
  wire.ranges()[1].last_ns(7);
  EXPECT_FALSE(fromWire(wire, back));
}

TEST(Adapters, RejectsNonFiniteNumbersInEveryField) {
  Counter n;
  auto map = someFrame<LocalMap>(n);
  map.objects = {someObservation(n)};
  v1::LocalMap good;
  toWire(map, RunClock::kDataset, good);
  LocalMap back;
  ASSERT_TRUE(fromWire(good, back));
  const std::vector<std::function<void(v1::LocalMap&)>> damages{
      [](auto& w) { w.camera_height_m(kNan); },
      [](auto& w) { w.motion().previous_from_current().x(kNan); },
      [](auto& w) { w.motion().previous_from_current().theta(std::numeric_limits<double>::infinity()); },
      [](auto& w) { w.motion().covariance()[4] = kNan; },
      [](auto& w) { w.motion().left_m(kNan); },
      [](auto& w) { w.floor_motion().previous_from_current().y(kNan); },
      [](auto& w) { w.floor_motion().covariance()[8] = kNan; },
      [](auto& w) { w.scan().origin().y(kNan); },
      [](auto& w) { w.scan().blind_m(kNan); },
      [](auto& w) { w.scan().range_m()[2] = kNanF; },
      [](auto& w) { w.scan().label()[2] = 200; },
      [](auto& w) { w.scan().sigma_m().resize(1); },
      [](auto& w) { w.objects()[0].centroid().x(kNan); },
      [](auto& w) { w.objects()[0].contact().y(kNan); },
      [](auto& w) { w.objects()[0].hull()[1].x(kNan); },
      [](auto& w) { w.objects()[0].solidity(kNanF); },
      [](auto& w) { w.objects()[0].height_m(kNanF); },
      [](auto& w) { w.objects()[0].vectors()[0].to_m()[0] = kNanF; },
      [](auto& w) { w.objects()[0].vectors()[0].point().position_m()[2] = kNanF; },
      [](auto& w) { w.objects()[0].vectors()[0].point().sigma_m(kNanF); },
      [](auto& w) { w.state(static_cast<v1::FrameState>(99)); },
  };
  for (std::size_t i = 0; i < damages.size(); ++i) {
    v1::LocalMap damaged = good;
    damages[i](damaged);
    EXPECT_FALSE(fromWire(damaged, back)) << "damage " << i;
  }
  // A support direction with a non-finite value is unused; the others stay valid.
  v1::LocalMap direction = good;
  direction.objects()[0].support().b_m()[3] = kNanF;
  ASSERT_TRUE(fromWire(direction, back));
  EXPECT_LE(back.objects[0].supports.sigma_m[3], 0.0);
  EXPECT_GT(back.objects[0].supports.sigma_m[4], 0.0);
}

/// Elements beyond the bound of an IDL sequence are omitted.
TEST(Adapters, OmitsObjectsBeyondIdlBound) {
  Counter n;
  auto map = someFrame<LocalMap>(n);
  map.objects.assign(80, someObservation(n));
  v1::LocalMap wire;
  toWire(map, RunClock::kDataset, wire);
  EXPECT_EQ(wire.objects().size(), 64u);
}

motion::FormationState someState(Counter& n) {
  motion::FormationState s;
  s.robot = "r1";
  s.acquired_ns = 17;
  s.sequence = 3;
  s.role = motion::FormationRole::kLeader;
  s.leader = "r1";
  s.behaviour = motion::Behaviour::kExploration;
  s.ground_clear = true;
  s.stop = n.pose();
  s.has_goal = true;
  s.goal_m = n.point();
  s.frontiers = 9;
  s.view.origin_m = n.point();
  s.view.blind_m = n.nextF();
  s.view.first_rad = n.nextF();
  s.view.step_rad = n.nextF();
  s.view.ray = {motion::View::entry(motion::View::kSolid, 1.234),
                motion::View::entry(motion::View::kFree, 2.5)};
  s.skipped = {{n.point(), true}, {n.point(), false}};
  return s;
}

TEST(FormationState, KeepsTheFieldsOfTheBehaviours) {
  Counter n;
  const motion::FormationState from = someState(n);
  v1::FormationState wire;
  toWire(from, RunClock::kSim, wire);
  motion::FormationState to;
  ASSERT_TRUE(fromWire(wire, to));
  EXPECT_EQ(to.behaviour, from.behaviour);
  EXPECT_TRUE(to.ground_clear && to.has_goal);
  EXPECT_EQ(to.stop.vector(), from.stop.vector());
  EXPECT_EQ(to.goal_m, from.goal_m);
  EXPECT_EQ(to.frontiers, from.frontiers);
  EXPECT_EQ(to.view.origin_m, from.view.origin_m);
  EXPECT_EQ(to.view.blind_m, from.view.blind_m);
  EXPECT_EQ(to.view.first_rad, from.view.first_rad);
  EXPECT_EQ(to.view.step_rad, from.view.step_rad);
  EXPECT_EQ(to.view.ray, from.view.ray);
  ASSERT_EQ(to.skipped.size(), 2u);
  EXPECT_EQ(to.skipped[0].place_m, from.skipped[0].place_m);
  EXPECT_TRUE(to.skipped[0].looked);
  EXPECT_FALSE(to.skipped[1].looked);
}

TEST(FormationState, IsRejectedWithAnInvalidFieldOfTheBehaviours) {
  const std::vector<std::function<void(v1::FormationState&)>> damages{
      [](auto& s) { s.behaviour(static_cast<v1::FormationBehaviour>(3)); },
      [](auto& s) { s.stop().theta(kNan); },
      [](auto& s) { s.goal().x(kNan); },
      [](auto& s) { s.view().first_rad(kNanF); },
      [](auto& s) { s.view().step_rad(0.0f); },
      [](auto& s) { s.view().blind_m(-1.0f); },
      [](auto& s) { s.view().ray().resize(motion::View::kMostRays + 1); },
      [](auto& s) { s.skipped()[0].place().y(kNan); }};
  for (std::size_t i = 0; i < damages.size(); ++i) {
    Counter n;
    v1::FormationState wire;
    toWire(someState(n), RunClock::kSim, wire);
    damages[i](wire);
    motion::FormationState to;
    EXPECT_FALSE(fromWire(wire, to)) << i;
  }
}

}  // namespace
}  // namespace omnifleet::adapters
