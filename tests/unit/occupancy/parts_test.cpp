#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "occupancy/body_mask.h"
#include "occupancy/contribution_store.h"
#include "occupancy/fixed_trig.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/robot_paths.h"
#include "occupancy/sha256.h"

namespace omnifleet::occupancy {
namespace {

TEST(FixedTrig, MatchesStandardSineAndCosine) {
  for (int angle = -70000; angle <= 70000; angle += 13) {
    const Direction d = directionOf(turnFromDmrad(angle));
    EXPECT_NEAR(static_cast<double>(d.cos_q30) / (1 << 30), std::cos(1e-4 * angle), 2e-7);
    EXPECT_NEAR(static_cast<double>(d.sin_q30) / (1 << 30), std::sin(1e-4 * angle), 2e-7);
  }
}

TEST(FixedTrig, IsExactAtTheAxes) {
  EXPECT_EQ(directionOf(0).sin_q30, 0);
  EXPECT_EQ(directionOf(turnOfBearing(1, 2)).sin_q30, 0);
  EXPECT_EQ(directionOf(turnOfBearing(1, 4)).cos_q30, 0);
  EXPECT_NEAR(static_cast<double>(directionOf(turnOfBearing(3, 4)).sin_q30), -(1 << 30), 100);
}

TEST(FixedTrig, RotatesForwardAndBack) {
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int32_t> any(-30000, 30000);
  for (int i = 0; i < 1000; ++i) {
    const PointDmm p{any(random), any(random)};
    const std::int32_t angle = any(random);
    const Direction d = directionOf(turnFromDmrad(angle));
    const PointDmm q = rotate(d, p);
    const Eigen::Vector2d expected = Eigen::Rotation2Dd(1e-4 * angle) * Eigen::Vector2d(p.x_dmm, p.y_dmm);
    EXPECT_NEAR(q.x_dmm, expected.x(), 0.51);  // rounded to the unit
    EXPECT_NEAR(q.y_dmm, expected.y(), 0.51);
    const PointDmm back = unrotate(d, q);
    EXPECT_LE(std::abs(back.x_dmm - p.x_dmm), 1);
    EXPECT_LE(std::abs(back.y_dmm - p.y_dmm), 1);
  }
}

TEST(FixedTrig, RoundsDivisionsAndRootsDown) {
  EXPECT_EQ(floorDivide(-1, 500), -1);
  EXPECT_EQ(floorDivide(-500, 500), -1);
  EXPECT_EQ(floorDivide(-501, 500), -2);
  EXPECT_EQ(floorDivide(499, 500), 0);
  EXPECT_EQ(integerSqrt(0), 0);
  EXPECT_EQ(integerSqrt(99), 9);
  EXPECT_EQ(integerSqrt(100), 10);
}

TEST(Sha256, MatchesFips180Examples) {  // FIPS 180-4 examples
  EXPECT_EQ(hexText(sha256("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hexText(sha256("")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(BodyMask, MatchesThePolygonAndItsMargin) {
  const Polygon footprint{{-0.1, -0.12}, {0.25, -0.12}, {0.32, 0.0}, {0.25, 0.12}, {-0.1, 0.12}};
  const BodyMask exact({0.0, footprint, 0.2, 0.2}, 0.0, 0.1), grown({0.0, footprint, 0.2, 0.2}, 0.03, 0.1);
  std::mt19937 random(2);
  std::uniform_int_distribution<std::int32_t> any(-4000, 4000);
  for (int i = 0; i < 3000; ++i) {
    const PointDmm p{any(random), any(random)};
    EXPECT_EQ(exact.covers(p), contains(footprint, {1e-4 * p.x_dmm, 1e-4 * p.y_dmm}));
    EXPECT_TRUE(grown.covers(p) || !exact.covers(p));
  }
  EXPECT_TRUE(grown.covers({-1290, 0}));
  EXPECT_FALSE(grown.covers({-1310, 0}));
  const BodyMask disc({0.15, {}, 0.2, 0.2}, 0.0, 0.1);
  EXPECT_TRUE(disc.covers({0, 1500}));
  EXPECT_FALSE(disc.covers({1100, 1100}));
  const BodyMask unknown({0.0, {}, 0.0, 0.0}, 0.0, 0.1);
  EXPECT_EQ(unknown.reachDmm(), 1000);
}

TEST(BodyMask, IsEnteredWhereARayMeetsItsNearSide) {
  const Polygon footprint{{-0.05, -0.06}, {0.11, -0.06}, {0.11, 0.06}, {-0.05, 0.06}};
  const BodyMask box({0.0, footprint, 0.2, 0.2}, 0.0, 0.1), disc({0.15, {}, 0.2, 0.2}, 0.0, 0.1);
  std::mt19937 random(5);
  std::uniform_int_distribution<std::int32_t> any(-15000, 15000);
  std::uniform_int_distribution<std::uint32_t> turn;
  int met = 0, grazed = 0;
  for (int i = 0; i < 20000; ++i) {
    const PointDmm from{any(random), any(random)};
    const Turn heading = turn(random);
    const double angle = 2.0 * M_PI * heading / 4294967296.0;
    const Eigen::Vector2d p = metres(from), along(std::cos(angle), std::sin(angle));
    const auto firstInside = [&](const auto& isInside) {  // by steps of 0.5 mm
      for (double t = 0.0; t < 4.5; t += 0.0005)
        if (isInside(Eigen::Vector2d(p + t * along))) return t;
      return -1.0;
    };
    const auto check = [&](const BodyMask& mask, double expected_m, const char* what) {
      const auto entry = mask.entry(from, directionOf(heading));
      if (expected_m < 0.0) {
        grazed += entry ? 1 : 0;  // a corner between two steps
        return;
      }
      ++met;
      ASSERT_TRUE(entry) << what << " " << i;
      EXPECT_NEAR(1e-4 * static_cast<double>(*entry), expected_m, 0.0012) << what << " " << i;
    };
    if (i % 10 != 0) continue;
    check(box, firstInside([&](const Eigen::Vector2d& q) { return contains(footprint, q); }), "box");
    check(disc, firstInside([](const Eigen::Vector2d& q) { return q.norm() < 0.15; }), "disc");
  }
  EXPECT_GT(met, 100);
  EXPECT_LT(grazed, 5);
}

KeyframePose poseAt(TimeNs time_ns, std::int32_t x, std::int32_t theta) {
  KeyframePose pose;
  pose.robot = "r1";
  pose.acquired_ns = time_ns;
  pose.valid = true;
  pose.position = {x, -x};
  pose.theta_dmrad = theta;
  return pose;
}

TEST(RobotPaths, InterpolatesAlongTheShorterRotation) {
  ContributionStore store;
  store.add(poseAt(0, 0, 31000));
  store.add(poseAt(1000000000, 1000, -31000));
  store.add(poseAt(20000000000, 5000, 0));
  const RobotPaths paths(store, 1000000000, 5000000000);
  const auto half = paths.at("r1", 500000000);
  ASSERT_TRUE(half);
  EXPECT_EQ(half->position.x_dmm, 500);
  EXPECT_EQ(half->position.y_dmm, -500);
  EXPECT_NEAR(std::abs(wrapAngle(1e-4 * half->theta_dmrad)), M_PI, 2e-4);
  EXPECT_EQ(paths.at("r1", 0)->theta_dmrad, 31000);
  EXPECT_EQ(paths.at("r1", 1800000000)->position.x_dmm, 1000);  // held at the nearest pose
  EXPECT_FALSE(paths.at("r1", 10000000000));                    // the gap is too long
  EXPECT_EQ(paths.at("r1", 19500000000)->position.x_dmm, 5000);
  EXPECT_FALSE(paths.at("r2", 0));
}

TEST(ContributionStore, KeepsTheWinningPoseAndCountsItems) {
  ContributionStore a, b;
  const KeyframePose first = poseAt(5, 10, 0);
  KeyframePose twin = first;  // same rank, other content: the larger bytes are kept, in either order
  twin.position.x_dmm = 20;
  EXPECT_TRUE(a.add(first));
  EXPECT_FALSE(a.add(first));
  a.add(twin);
  b.add(twin);
  b.add(first);
  EXPECT_EQ(a.find("r1", 5)->pose->position.x_dmm, b.find("r1", 5)->pose->position.x_dmm);
  Contribution c;
  c.robot = "r1";
  c.acquired_ns = 7;
  c.range_dmm = {1, 2};
  a.add(c);
  EXPECT_EQ(b.find("r1", 7), nullptr);
  b.add(c);
  EXPECT_EQ(a.find("r1", 7)->contribution_digest, b.find("r1", 7)->contribution_digest);
  EXPECT_EQ(a.find("r1", 5)->pose_digest, b.find("r1", 5)->pose_digest);
  EXPECT_EQ(a.contributions(), 1U);
  EXPECT_EQ(a.poses(), 1U);
}

TEST(Contribution, QuantizesAndRejectsNonFiniteValues) {
  Objects objects;
  objects.robot = "r1";
  objects.camera_height_m = 0.5;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  objects.scan.range_m = {1.00004F, nan, -1.0F, 1e9F};
  objects.scan.label.assign(4, RayLabel::kObstacle);
  objects.scan.object = {7, 7, 7, 7};
  Track track;
  track.id = 70001;
  track.visible = true;
  track.supports.b_m = {0.12345F, nan, 1.0F};
  track.supports.sigma_m = {0.002F, 0.002F, -1.0F};
  track.solidity = 0.9;
  objects.tracks = {track, Track{}};
  const Contribution c = makeContribution(objects);
  EXPECT_EQ(c.camera_height_dmm, 5000);
  EXPECT_EQ(c.range_dmm, (std::vector<std::int32_t>{10000, 0, 0, 0}));
  EXPECT_EQ(c.label[1], RayLabel::kInvalid);
  ASSERT_EQ(c.views.size(), 1U);  // a predicted track gives no view
  EXPECT_EQ(c.views[0].solidity_permille, 900);
  EXPECT_EQ(c.views[0].sigma_dmm, (std::vector<std::uint16_t>{20, 0, 0}));
  const SupportFunction supports = supportsOf(c.views[0]);
  EXPECT_NEAR(supports.b_m[0], 0.1235F, 6e-5);  // half a unit
  EXPECT_EQ(supports.sigma_m[1], 0.0F);

  PoseEstimate pose;
  pose.valid = true;
  pose.map_from_base = {1.23456, -2.0, 7.0};
  const KeyframePose made = makeKeyframePose(pose, 2, 3);
  EXPECT_EQ(made.position.x_dmm, 12346);
  EXPECT_NEAR(made.mapFromBase().theta_rad, 7.0 - 2 * M_PI, 5.1e-5);
  EXPECT_EQ(made.term, 2U);
  pose.map_from_base.x_m = nan;
  EXPECT_FALSE(makeKeyframePose(pose).valid);
}

}  // namespace
}  // namespace omnifleet::occupancy
