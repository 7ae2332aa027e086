#include "laser/laser_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "geometry/pose2.h"
#include "tests/unit/laser/room.h"

namespace omnifleet::laser {
namespace {

constexpr double kSigma_m = 0.005;

dataset::LaserSensor sensor() {
  dataset::LaserSensor s;
  s.range_max_m = 5.0;
  s.range_sigma_m = kSigma_m;
  return s;
}

/// RMS of the usable supports against the true ones of the footprint about `c`, and their number.
struct SupportError {
  double rms_m = 0.0, worst_sigmas = 0.0;
  int usable = 0;
};
SupportError compareSupports(const SupportFunction& seen, const Polygon& footprint,
                             const Eigen::Vector2d& c) {
  const SupportFunction truth = SupportFunction::of(footprint, c, 1.0);
  SupportError a;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (seen.sigma_m[k] <= 0.0f) continue;
    const double off = seen.b_m[k] - truth.b_m[k];
    a.rms_m += off * off;
    a.worst_sigmas = std::max(a.worst_sigmas, std::abs(off) / seen.sigma_m[k]);
    ++a.usable;
  }
  a.rms_m = std::sqrt(a.rms_m / std::max(1, a.usable));
  return a;
}

/// A box seen over one corner: supports of both facing sides, 180° minus the angle that the box spans.
TEST(LaserMapper, MeasuresFacingSidesOfABoxWithoutNoise) {
  test::Room room;
  room.polygons.push_back(test::box({1.2, 0.3}, {0.30, 0.20}, 0.5));
  LaserMapper mapper(sensor(), {});
  const LocalMap& map = mapper.process(room.scan(720), 7, {});
  EXPECT_EQ(map.state, FrameState::kOk);
  EXPECT_EQ(map.sequence, 7u);
  EXPECT_EQ(map.camera_height_m, 0.0);
  ASSERT_EQ(map.objects.size(), 1u);
  const SupportError a = compareSupports(map.objects[0].supports, room.polygons[0], {0, 0});
  // The ends are known to half a beam: 0.25° at 1.2 m are 5 mm. The faces are exact.
  EXPECT_LT(a.rms_m, 0.003);
  // Of 96 directions, those between the normals of the tangents. The box spans about 16°.
  EXPECT_NEAR(a.usable, (180.0 - 16.0) / 3.75, 2.0);
  EXPECT_FALSE(map.objects[0].truncated);
}

TEST(LaserMapper, KeepsSupportsWithinTheirNoise) {
  double squares = 0.0;
  int views = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    test::Room room;
    const double turn = 0.16 * seed, far = 0.8 + 0.03 * seed;
    const Eigen::Vector2d at(far * std::cos(turn), far * std::sin(turn));
    if (seed % 2 == 0) {
      room.polygons.push_back(test::box(at, {0.30, 0.20}, 0.37 * seed));
    } else {
      room.discs.push_back({at, 0.12});
    }
    LaserMapper mapper(sensor(), {});
    const LocalMap& map = mapper.process(room.scan(720, kSigma_m, seed), 0, {});
    ASSERT_EQ(map.objects.size(), 1u) << seed;
    const Polygon truth = seed % 2 == 0 ? room.polygons[0] : circlePolygon(at, 0.12, 720);
    const SupportError a = compareSupports(map.objects[0].supports, truth, {0, 0});
    EXPECT_GT(a.usable, 34) << seed;
    EXPECT_LT(a.rms_m, 0.02) << seed;
    squares += a.rms_m * a.rms_m;
    ++views;
  }
  // σ of one echo is 5 mm. A face has ten or more echoes. Its end is known to half a beam (5 mm at 1.2 m).
  EXPECT_LT(std::sqrt(squares / views), 0.006);
}

/// An arc is distinguished from faces and gives the supports of its circle.
TEST(LaserMapper, RecognizesCylinder) {
  test::Room room;
  room.discs.push_back({{0.0, -1.0}, 0.15});
  LaserMapper mapper(sensor(), {});
  const LocalMap& map = mapper.process(room.scan(720), 0, {});
  ASSERT_EQ(map.objects.size(), 1u);
  const SupportError a =
      compareSupports(map.objects[0].supports, circlePolygon({0.0, -1.0}, 0.15, 1440), {0, 0});
  EXPECT_LT(a.rms_m, 1e-4);  // float rounding of the ranges
  EXPECT_NEAR(map.objects[0].contact_m.y(), -0.85, 1e-3);
}

/// The scanner is mounted off the centre and turned. All output is in base_link.
TEST(LaserMapper, AppliesMountingPose) {
  dataset::LaserSensor mounted = sensor();
  mounted.position_m = {0.10, -0.05, 0.2};
  mounted.yaw_deg = 90.0;
  test::Room room;  // in the scanner's frame
  room.discs.push_back({{1.0, 0.0}, 0.15});
  LaserMapper mapper(mounted, {});
  const LocalMap& map = mapper.process(room.scan(720), 0, {});
  ASSERT_EQ(map.objects.size(), 1u);
  EXPECT_NEAR(map.objects[0].contact_m.x(), 0.10, 2e-3);
  EXPECT_NEAR(map.objects[0].contact_m.y(), -0.05 + 0.85, 1e-3);
  EXPECT_EQ(map.scan.origin_m, Eigen::Vector2d(0.10, -0.05));
  EXPECT_NEAR(map.scan.range_m[180], 0.85, 1e-3) << "directly to the left";
}

/// Half of the farther box is hidden behind the nearer one.
TEST(LaserMapper, OmitsSupportsOfHiddenEnds) {
  test::Room room;
  room.polygons = {test::box({0.8, -0.12}, {0.2, 0.2}, 0.0), test::box({1.6, 0.0}, {0.2, 0.4}, 0.0)};
  LaserMapper mapper(sensor(), {});
  const LocalMap& map = mapper.process(room.scan(1440), 0, {});
  ASSERT_EQ(map.objects.size(), 2u);
  for (const ObjectObservation& object : map.objects) {
    const bool near = object.contact_m.x() < 1.0;
    EXPECT_EQ(object.truncated, !near);
    EXPECT_LT(compareSupports(object.supports, room.polygons[near ? 0 : 1], {0, 0}).rms_m, 0.003);
  }
}

/// Two boxes that touch at a concave corner are two objects.
TEST(LaserMapper, SeparatesTouchingObjectsAtConcaveCorner) {
  test::Room room;
  room.polygons = {test::box({1.0, 0.15}, {0.3, 0.3}, 0.0), test::box({1.2, -0.15}, {0.3, 0.3}, 0.0)};
  LaserMapper mapper(sensor(), {});
  const LocalMap& map = mapper.process(room.scan(1440), 0, {});
  ASSERT_EQ(map.objects.size(), 2u);
  EXPECT_GT(std::abs(map.objects[0].contact_m.x() - map.objects[1].contact_m.x()), 0.1);
}

/// Walls are no objects; their rays are obstacles. Rays without an echo are free up to the maximum range.
TEST(LaserMapper, LabelsScanOfAHalfOpenRoom) {
  test::Room room;
  room.polygons = {{{2.0, -2.0}, {2.2, -2.0}, {2.2, 2.0}, {2.0, 2.0}}};
  room.discs.push_back({{0.0, 1.0}, 0.2});
  LaserMapper mapper(sensor(), {});
  const LocalMap& map = mapper.process(room.scan(500), 0, {});
  const Scan& scan = map.scan;
  ASSERT_EQ(scan.range_m.size(), 500u);
  ASSERT_EQ(map.objects.size(), 1u);
  EXPECT_EQ(scan.label[0], RayLabel::kObstacle);
  EXPECT_NEAR(scan.range_m[0], 2.0, 1e-5);
  EXPECT_NEAR(scan.range_m[40], 2.0 / std::cos(2.0 * M_PI * 40 / 500), 1e-4) << "between two beams";
  EXPECT_EQ(scan.label[125], RayLabel::kUnknown);
  EXPECT_EQ(scan.object[125], map.objects[0].label);
  EXPECT_NEAR(scan.range_m[125], 0.8, 1e-4);
  EXPECT_EQ(scan.label[250], RayLabel::kFloorEnd);
  EXPECT_EQ(scan.range_m[250], 5.0f);
}

/// Rays outside of the field of view are invalid.
TEST(LaserMapper, LeavesRaysOutsideTheFieldOfViewInvalid) {
  test::Room room;
  room.polygons.push_back(test::box({0.0, 0.0}, {4.0, 4.0}, 0.0));
  dataset::LaserRow row = room.scan(720);
  row.angle_min_rad = -M_PI_2;  // beams from −90° to +90°
  row.range_m.erase(row.range_m.begin(), row.range_m.begin() + 180);
  row.range_m.resize(361);
  LaserMapper mapper(sensor(), {});
  const Scan& scan = mapper.process(row, 0, {}).scan;
  ASSERT_EQ(scan.label.size(), 720u);
  EXPECT_EQ(scan.label[179], RayLabel::kObstacle);
  EXPECT_EQ(scan.label[181], RayLabel::kInvalid);
  EXPECT_EQ(scan.label[539], RayLabel::kInvalid);
  EXPECT_EQ(scan.label[541], RayLabel::kObstacle);
  EXPECT_NEAR(scan.range_m[0], 2.0, 1e-5);
}

/// In a room without walls the objects in a scan may be moving robots, here two of three: the scan is not
/// matched.
TEST(LaserMapper, IgnoresObjectsThatMayMoveInScanMatching) {
  const Pose2 truth{0.05, 0.0, 0.02};
  const auto roomWith = [](const Pose2& pose, double gone_m) {
    const Pose2 here = pose.inverse();
    test::Room room;
    room.discs.push_back({here * Eigen::Vector2d(0.9, 0.2), 0.15});
    room.discs.push_back({here * Eigen::Vector2d(-0.5 + gone_m, 0.8), 0.15});
    room.discs.push_back({here * Eigen::Vector2d(0.2 + gone_m, -0.9), 0.15});
    return room;
  };
  LaserMapper mapper(sensor(), {});
  Motion wheels;
  wheels.valid = true;
  wheels.previous_from_current = truth;
  wheels.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
  mapper.process(roomWith({}, 0.0).scan(720, kSigma_m, 1), 0, {});
  const Motion& motion = mapper.process(roomWith(truth, 0.05).scan(720, kSigma_m, 2), 1, wheels).motion;
  EXPECT_EQ(motion.previous_from_current.vector(), truth.vector());
  EXPECT_EQ(motion.covariance, wheels.covariance);
}

/// A scan without any echo must not make the room free.
TEST(LaserMapper, RejectsScanWithoutAnyEcho) {
  test::Room room;
  room.discs.push_back({{1.0, 0.0}, 0.1});
  LaserMapper mapper(sensor(), {});
  dataset::LaserRow row = room.scan(720);
  EXPECT_EQ(mapper.process(row, 0, {}).state, FrameState::kOk);
  EXPECT_STREQ(mapper.fault(), "");
  dataset::LaserRow millimetres = row;
  for (float& range : millimetres.range_m) range *= 1000.0f;
  EXPECT_EQ(mapper.process(millimetres, 1, {}).state, FrameState::kDark);
  EXPECT_THAT(mapper.fault(), ::testing::HasSubstr("in metres"));
  row.range_m.assign(row.range_m.size(), INFINITY);
  const LocalMap& map = mapper.process(row, 2, {});
  EXPECT_EQ(map.state, FrameState::kDark);
  EXPECT_TRUE(map.scan.range_m.empty());
  EXPECT_THAT(mapper.fault(), ::testing::HasSubstr("no beam has an echo"));
}

TEST(LaserMapper, ReportsStateOfInvalidScans) {
  test::Room room;
  room.discs.push_back({{1.0, 0.0}, 0.1});
  LaserMapper mapper(sensor(), {});
  const dataset::LaserRow good = room.scan(360);
  EXPECT_EQ(mapper.process(good, 0, {}).state, FrameState::kOk);
  const auto stateOf = [&](auto&& spoil) {
    dataset::LaserRow row = good;
    spoil(row);
    const LocalMap& map = mapper.process(row, 0, {});
    EXPECT_TRUE(map.objects.empty() && map.scan.range_m.empty());
    return map.state;
  };
  EXPECT_EQ(stateOf([](auto& row) { row.angle_increment_rad = 0.0; }), FrameState::kNonFinite);
  EXPECT_EQ(stateOf([](auto& row) { row.angle_increment_rad *= 2.0; }), FrameState::kNonFinite)
      << "more than one full turn";
  EXPECT_EQ(stateOf([](auto& row) { row.angle_min_rad = std::nan(""); }), FrameState::kNonFinite);
  EXPECT_EQ(stateOf([](auto& row) { row.range_m[5] = std::nanf(""); }), FrameState::kNonFinite);
  EXPECT_EQ(stateOf([](auto& row) { row.range_m[5] = -1.0f; }), FrameState::kNonFinite);
  EXPECT_EQ(stateOf([](auto& row) { row.range_m.clear(); }), FrameState::kNonFinite);
  EXPECT_EQ(stateOf([](auto& row) { row.range_m.pop_back(); }), FrameState::kWrongSize);
  EXPECT_EQ(mapper.process(good, 0, {}).state, FrameState::kOk) << "a valid scan after invalid ones";
}

}  // namespace
}  // namespace omnifleet::laser
