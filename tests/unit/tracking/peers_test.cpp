#include "tracking/peers.h"

#include <gtest/gtest.h>

#include "tracking/vector_motion.h"

namespace omnifleet::tracking {
namespace {

constexpr TimeNs kFrame_ns = 100'000'000;

PoseEstimate pose(const std::string& robot, TimeNs time_ns, const Pose2& map_from_base) {
  PoseEstimate estimate;
  estimate.robot = robot;
  estimate.acquired_ns = time_ns;
  estimate.valid = true;
  estimate.map_from_base = map_from_base;
  estimate.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();
  return estimate;
}

class PeersTest : public testing::Test {
 protected:
  PeersTest() {
    RobotBody body;
    body.radius_m = 0.15;
    body.height_m = 0.3;
    bodies_ = {{"r1", body}, {"r2", body}, {"r3", body}};
  }
  /// Moves r1 straight at 0.3 m/s up to a frame.
  void drive(int frame) {
    for (int i = next_; i <= frame; ++i) {
      Motion motion;
      motion.valid = i > 0;
      motion.since_ns = (i - 1) * kFrame_ns;
      motion.previous_from_current = {0.03, 0.0, 0.0};
      own_.advance(motion, i * kFrame_ns);
    }
    next_ = frame + 1;
  }
  int next_ = 0;
  std::map<std::string, RobotBody> bodies_;
  OwnMotion own_;
};

TEST_F(PeersTest, ExtrapolatesAllPeersToThisFrame) {
  Peers peers({}, "r1", bodies_);
  const auto r1 = [](int i) { return pose("r1", i * kFrame_ns, {1.0, 1.0 + 0.03 * i, M_PI / 2}); };
  const auto r2 = [](int i) { return pose("r2", i * kFrame_ns, {2.0 + 0.02 * i, 1.5, 0.0}); };
  drive(9);
  for (int i = 0; i < 9; ++i) peers.predict({r1(i), r2(i)}, own_);
  drive(10);  // feedback: the poses are those of the previous frame, 9
  const auto& all = peers.predict({r1(9), r2(9)}, own_);
  ASSERT_EQ(all.size(), 2U);
  ASSERT_EQ(all[0].robot, "r2");
  EXPECT_TRUE(all[0].known);
  EXPECT_FALSE(all[1].known) << "r3 has published nothing";
  // map → odom in closed form: r1 started at (1, 1) facing +y, which is its odom frame.
  const Pose2 map_from_odom{1.0, 1.0, M_PI / 2};
  const Eigen::Vector2d expected = map_from_odom.inverse() * Eigen::Vector2d(2.2, 1.5);
  EXPECT_LT((all[0].centre_m - expected).norm(), 1e-3);  // the velocity is a running mean of steps
  EXPECT_NEAR(all[0].velocity_mps.norm(), 0.2, 1e-3);
  EXPECT_LT(all[0].covariance.trace(), 0.01);
}

/// Without wheels odom restarts with every frame.
TEST_F(PeersTest, ExtrapolatesOwnPoseByVelocityWithoutWheels) {
  Peers peers({}, "r1", bodies_);
  const auto r1 = [](int i) { return pose("r1", i * kFrame_ns, {1.0, 1.0 + 0.03 * i, M_PI / 2}); };
  const auto r2 = [](int i) { return pose("r2", i * kFrame_ns, {2.0, 1.5, 0.0}); };
  double trace = 0.0;
  for (int i = 0; i <= 10; ++i) {
    own_.advance({}, i * kFrame_ns);
    const auto& all = peers.predict({r1(i - 1), r2(i - 1)}, own_);
    if (i < 10) continue;
    ASSERT_TRUE(all[0].known);
    const Pose2 map_from_base{1.0, 1.3, M_PI / 2};
    const Eigen::Vector2d expected =
        own_.odomFromBase() * (map_from_base.inverse() * Eigen::Vector2d(2.0, 1.5));
    EXPECT_LT((all[0].centre_m - expected).norm(), 1e-3);
    trace = all[0].covariance.trace();
  }
  drive(10);
  EXPECT_GT(trace, peers.predict({}, own_)[0].covariance.trace()) << "less certain than with wheels";
}

TEST_F(PeersTest, DropsPeerWithAnOldPose) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  peers.predict({pose("r1", 0, {}), pose("r2", 0, {1.0, 0.0, 0.0})}, own_);
  EXPECT_TRUE(peers.all()[0].known);
  drive(30);
  EXPECT_FALSE(peers.predict({pose("r1", 29 * kFrame_ns, {})}, own_)[0].known)
      << "its pose is three seconds old";
}

TEST_F(PeersTest, UsesInitialPosesUntilTheFirstPose) {
  Peers peers({}, "r1", bodies_);
  drive(0);
  peers.setInitialPoses(
      {pose("r1", 0, {1.0, 1.0, 0.0}), pose("r2", 0, {1.5, 1.0, 0.0}), pose("r3", 0, {1.0, 2.0, 0.0})});
  const auto& all = peers.predict({}, own_);
  ASSERT_EQ(all.size(), 2U);
  ASSERT_TRUE(all[0].known && all[1].known);
  EXPECT_NEAR((all[0].centre_m - Eigen::Vector2d(0.5, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((all[1].centre_m - Eigen::Vector2d(0.0, 1.0)).norm(), 0.0, 1e-9);
  drive(1);
  peers.predict({pose("r1", 0, {2.0, 1.0, 0.0}), pose("r2", 0, {2.7, 1.0, 0.0})}, own_);
  ASSERT_TRUE(all[0].known);
  EXPECT_NEAR((all[0].centre_m - Eigen::Vector2d(0.7, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR(all[0].velocity_mps.norm(), 0.0, 1e-9) << "an initial pose gives no velocity";
  EXPECT_FALSE(all[1].known) << "others have published, r3 has not";
}

TEST_F(PeersTest, PlacesNoPeerWithoutOwnPose) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  EXPECT_FALSE(peers.predict({pose("r2", 0, {1.0, 0.0, 0.0})}, own_)[0].known);
}

TEST_F(PeersTest, IgnoresInvalidAndNonFinitePoses) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  PoseEstimate invalid = pose("r2", 0, {1.0, 0.0, 0.0}), broken = pose("r3", 0, {std::nan(""), 0.0, 0.0});
  invalid.valid = false;
  const auto& all = peers.predict({pose("r1", 0, {}), invalid, broken}, own_);
  EXPECT_FALSE(all[0].known);
  EXPECT_FALSE(all[1].known);
}

/// Numbers of another frame say nothing about where a robot is in map, whatever they are.
TEST_F(PeersTest, IgnoresPosesInAnotherFrame) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  PoseEstimate own_frame = pose("r2", 0, {1.0, 0.0, 0.0});
  own_frame.frame = "r2";
  const auto& all = peers.predict({pose("r1", 0, {}), own_frame, pose("r3", 0, {0.0, 1.0, 0.0})}, own_);
  EXPECT_FALSE(all[0].known) << "r2 is not related to map";
  EXPECT_TRUE(all[1].known);
  // Matched: the same robot in map.
  drive(2);
  peers.predict({pose("r1", kFrame_ns, {0.03, 0.0, 0.0}), pose("r2", kFrame_ns, {2.0, 1.0, 0.0})}, own_);
  ASSERT_TRUE(all[0].known);
  EXPECT_NEAR((all[0].centre_m - Eigen::Vector2d(2.0, 1.0)).norm(), 0.0, 1e-9) << "odom is map here";
  EXPECT_NEAR(all[0].velocity_mps.norm(), 0.0, 1e-9) << "a change of frame is no motion";
}

TEST_F(PeersTest, PlacesNoPeerWhileItIsInAnotherFrameItself) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  PoseEstimate own_frame = pose("r1", 0, {1.0, 1.0, 0.0});
  own_frame.frame = "r1";
  peers.setInitialPoses({own_frame});
  EXPECT_FALSE(peers.predict({own_frame, pose("r2", 0, {1.5, 1.0, 0.0})}, own_)[0].known);
  EXPECT_EQ(peers.own(), nullptr);
}

TEST_F(PeersTest, IgnoresUncertainPose) {
  Peers peers({}, "r1", bodies_);
  drive(1);
  PoseEstimate lost = pose("r2", 0, {1.0, 0.0, 0.0});
  lost.covariance = Eigen::Matrix3d::Identity();
  EXPECT_FALSE(peers.predict({pose("r1", 0, {}), lost}, own_)[0].known);
}

/// Flow vector of a point at height h, stationary or moved by `moved`, for a camera at H = 0.5 m that moved
/// by `motion`.
FlowVector vectorOf(const Eigen::Vector2d& point, double height_m, const Eigen::Vector2d& moved,
                    const Motion& motion) {
  const double s = 0.5 / (0.5 - height_m);
  const Pose2 current_from_previous = motion.previous_from_current.inverse();
  FlowVector vector;
  vector.from_px.setZero();
  vector.to_px.setZero();
  vector.from_m = (s * point).cast<float>();
  vector.to_m = (s * (current_from_previous * (point + moved))).cast<float>();
  vector.residual_m = vector.to_m - (current_from_previous * (s * point).eval()).cast<float>();
  return vector;
}

TEST(VectorMotion, SeparatesStaticPointsFromMovingOnes) {
  Motion motion;
  motion.valid = true;
  motion.previous_from_current = {0.05, 0.01, 0.2};
  ObjectObservation standing, moving;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector2d point(0.8 + 0.03 * i, 0.3 - 0.02 * i);
    standing.vectors.push_back(vectorOf(point, 0.04 * i, {0.0, 0.0}, motion));
    moving.vectors.push_back(vectorOf(point, 0.04 * i, {0.05, 0.01}, motion));  // moves with the robot
  }
  const VectorMotion still = vectorMotion(standing, motion, {0.0, 0.0}, 1e-3);
  ASSERT_TRUE(still.valid);
  EXPECT_EQ(still.moving_share, 0.0);
  EXPECT_EQ(kindByVectors(still, motion), ObjectKind::kObstacle);
  const VectorMotion pacing = vectorMotion(moving, motion, {0.0, 0.0}, 1e-3);
  EXPECT_EQ(pacing.moving_share, 1.0);
  EXPECT_EQ(kindByVectors(pacing, motion), ObjectKind::kRobot);
}

TEST(VectorMotion, IsInvalidWithoutMotionOrVectors) {
  Motion motion;
  EXPECT_FALSE(vectorMotion({}, motion, {0.0, 0.0}, 1e-3).valid);
  motion.valid = true;
  const VectorMotion none = vectorMotion({}, motion, {0.0, 0.0}, 1e-3);
  EXPECT_FALSE(none.valid);
  EXPECT_EQ(kindByVectors(none, motion), ObjectKind::kUnknown);
}

}  // namespace
}  // namespace omnifleet::tracking
