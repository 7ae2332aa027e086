// Domain types survive the conversion to IDL types and back: every field has its own value. Non-finite
// numbers are rejected in every field.

#include "adapters/adapters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace omnifleet::adapters {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();

/// Returns a new value at every call, exactly representable as float.
struct Counter {
  double next() { return value_ += 0.25; }
  float nextF() { return static_cast<float>(next()); }
  Eigen::Vector2d point() { return {next(), next()}; }
  Eigen::Vector2f pointF() { return {nextF(), nextF()}; }
  Pose2 pose() { return {next(), next(), 0.001 * next()}; }
  template <int N>
  Eigen::Matrix<double, N, N> matrix() {
    Eigen::Matrix<double, N, N> m;
    for (int r = 0; r < N; ++r) {
      for (int c = 0; c < N; ++c) m(r, c) = next();
    }
    return m;
  }

 private:
  double value_ = 1.0;
};

Motion someMotion(Counter& n) {
  Motion m;
  m.valid = true;
  m.since_ns = 123456789012345;
  m.previous_from_current = n.pose();
  m.covariance = n.matrix<3>();
  m.left_m = n.next();
  m.right_m = n.next();
  m.wheels_rejected = true;
  return m;
}

Scan someScan(Counter& n) {
  Scan s;
  s.origin_m = n.point();
  s.blind_m = n.next();
  for (int i = 0; i < 5; ++i) {
    s.range_m.push_back(n.nextF());
    s.sigma_m.push_back(n.nextF());
    s.label.push_back(static_cast<RayLabel>(i));
    s.object.push_back(static_cast<std::uint16_t>(100 + i));
  }
  return s;
}

ScenePoint somePoint(Counter& n) {
  return {{n.nextF(), n.nextF(), n.nextF()}, n.nextF()};
}

SupportFunction someSupports(Counter& n) {
  SupportFunction s;
  for (int i = 0; i < 8; ++i) {
    s.b_m.push_back(n.nextF());
    s.sigma_m.push_back(n.nextF());
  }
  return s;
}

ObjectObservation someObservation(Counter& n) {
  ObjectObservation o;
  o.label = 7;
  o.rect_x_px = 11, o.rect_y_px = 12, o.rect_width_px = 13, o.rect_height_px = 14;
  o.hull_m = {n.point(), n.point(), n.point()};
  o.centroid_m = n.point();
  o.contact_m = n.point();
  o.supports = someSupports(n);
  o.solidity = n.next();
  o.truncated = true;
  o.height_m = n.next();
  o.height_sigma_m = n.next();
  o.vectors.push_back({n.pointF(), n.pointF(), n.pointF(), n.pointF(), n.pointF(), somePoint(n)});
  return o;
}

Track someTrack(Counter& n) {
  Track t;
  t.id = 4000000000u;
  t.kind = ObjectKind::kRobot;
  t.kind_probability = 0.75;
  t.visible = true;
  t.position_m = n.point();
  t.velocity_mps = n.point();
  t.covariance = n.matrix<2>();
  t.contact_m = n.point();
  t.hull_m = {n.point(), n.point(), n.point(), n.point()};
  t.supports = someSupports(n);
  t.solidity = n.next();
  t.truncated = true;
  t.height_m = n.next();
  t.height_sigma_m = n.next();
  t.points = {somePoint(n), somePoint(n)};
  return t;
}

template <class Frame>
Frame someFrame(Counter& n) {
  Frame f;
  f.robot = "r1";
  f.acquired_ns = 987654321098765;
  f.sequence = 42;
  f.state = FrameState::kDark;
  f.camera_height_m = n.next();
  f.motion = someMotion(n);
  f.scan = someScan(n);
  return f;
}

void expectEqual(const Motion& a, const Motion& b) {
  EXPECT_EQ(a.valid, b.valid);
  EXPECT_EQ(a.since_ns, b.since_ns);
  EXPECT_EQ(a.previous_from_current.vector(), b.previous_from_current.vector());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.left_m, b.left_m);
  EXPECT_EQ(a.right_m, b.right_m);
  EXPECT_EQ(a.wheels_rejected, b.wheels_rejected);
}

void expectEqual(const Scan& a, const Scan& b) {
  EXPECT_EQ(a.origin_m, b.origin_m);
  EXPECT_EQ(a.blind_m, b.blind_m);
  EXPECT_EQ(a.range_m, b.range_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
  EXPECT_EQ(a.label, b.label);
  EXPECT_EQ(a.object, b.object);
}

void expectEqual(const ScenePoint& a, const ScenePoint& b) {
  EXPECT_EQ(a.point_m, b.point_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
}

void expectEqual(const SupportFunction& a, const SupportFunction& b) {
  EXPECT_EQ(a.b_m, b.b_m);
  EXPECT_EQ(a.sigma_m, b.sigma_m);
}

template <class Frame>
void expectEqualFrames(const Frame& a, const Frame& b) {
  EXPECT_EQ(a.robot, b.robot);
  EXPECT_EQ(a.acquired_ns, b.acquired_ns);
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.camera_height_m, b.camera_height_m);
  expectEqual(a.motion, b.motion);
  expectEqual(a.scan, b.scan);
}

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
  wire.scan().label().front() = 6;
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
  EXPECT_EQ(back.frame, "r2");
  ASSERT_EQ(back.sightings.size(), 2u);
  EXPECT_EQ(back.sightings[1].track_id, 10u);
  EXPECT_EQ(back.sightings[1].robot, "r3");
}

SignatureFormat someFormat() {
  return {64, 512, 2, 3, 1, -0.25f, 0.5f, "equidistant 1280x960"};
}
StoredSignature someSignature() {
  return {{1, 2, 3, 4, 255, 254, 253, 252}, {0.5f, 2.0f}};
}

TEST(Adapters, PreservesAppearance) {
  Counter n;
  auto from = someFrame<Objects>(n);
  from.state = FrameState::kOk;
  Appearance& seen = from.appearance;
  seen.since_ns = 5, seen.turn_rad = 0.25, seen.turn_sigma_rad = 0.125;
  seen.confidence = 0.5f, seen.difference = 0.75f;
  seen.format = someFormat();
  seen.signature = someSignature();
  v1::Objects wire;
  toWire(from, RunClock::kDataset, wire);
  Objects back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.appearance.since_ns, 5);
  EXPECT_EQ(back.appearance.turn_rad, 0.25);
  EXPECT_EQ(back.appearance.turn_sigma_rad, 0.125);
  EXPECT_EQ(back.appearance.confidence, 0.5f);
  EXPECT_EQ(back.appearance.difference, 0.75f);
  EXPECT_TRUE(back.appearance.format == seen.format);
  EXPECT_EQ(back.appearance.signature.bytes, seen.signature.bytes);
  EXPECT_EQ(back.appearance.signature.scale, seen.signature.scale);
}

TEST(Adapters, RefusesSignatureThatDoesNotFitItsFormat) {
  Counter n;
  auto from = someFrame<Objects>(n);
  from.state = FrameState::kOk;
  from.appearance.format = someFormat();
  from.appearance.signature = someSignature();
  v1::Objects wire;
  toWire(from, RunClock::kDataset, wire);
  Objects back;
  ASSERT_TRUE(fromWire(wire, back));
  wire.appearance().signature().pop_back();
  EXPECT_FALSE(fromWire(wire, back));
  EXPECT_EQ(back.acquired_ns, from.acquired_ns);  // the frame keeps its place in the stream
}

TEST(Adapters, PreservesPlace) {
  Counter n;
  Place from;
  from.robot = "r1", from.index = 4, from.acquired_ns = 9, from.sequence = 8, from.frame = "r1";
  from.frame_from_base = n.pose();
  from.covariance = n.matrix<3>();
  from.metric = false;
  from.format = someFormat();
  from.signature = someSignature();
  from.links = {{false, "r1", 3, n.pose(), n.matrix<3>()}, {true, "r2", 17, n.pose(), n.matrix<3>()}};
  v1::Place wire;
  toWire(from, RunClock::kDataset, wire);
  Place back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.index, 4u);
  EXPECT_EQ(back.frame, "r1");
  EXPECT_EQ(back.frame_from_base.vector(), from.frame_from_base.vector());
  EXPECT_EQ(back.covariance, from.covariance);
  EXPECT_FALSE(back.metric);
  EXPECT_EQ(back.signature.bytes, from.signature.bytes);
  ASSERT_EQ(back.links.size(), 2u);
  EXPECT_TRUE(back.links[1].closes_loop);
  EXPECT_EQ(back.links[1].robot, "r2");
  EXPECT_EQ(back.links[1].index, 17u);
  EXPECT_EQ(back.links[1].this_from_other.vector(), from.links[1].this_from_other.vector());
  EXPECT_EQ(back.links[1].covariance, from.links[1].covariance);
}

TEST(Adapters, PreservesAlignment) {
  Counter n;
  Alignment from;
  from.robot = "r2", from.acquired_ns = 11;
  from.status = AlignmentStatus::kRefused;
  from.frame = "r2", from.reason = "walls agree, furniture does not", from.score = 0.5;
  from.map_from_frame = n.pose();
  from.covariance = n.matrix<3>();
  v1::Alignment wire;
  toWire(from, RunClock::kDataset, wire);
  Alignment back;
  ASSERT_TRUE(fromWire(wire, back));
  EXPECT_EQ(back.robot, "r2");
  EXPECT_EQ(back.status, AlignmentStatus::kRefused);
  EXPECT_EQ(back.frame, "r2");
  EXPECT_EQ(back.reason, from.reason);
  EXPECT_EQ(back.score, 0.5);
  EXPECT_EQ(back.map_from_frame.vector(), from.map_from_frame.vector());
  EXPECT_EQ(back.covariance, from.covariance);
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
