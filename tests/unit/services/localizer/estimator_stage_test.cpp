#include "localizer/estimator_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace omnifleet::localizer {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<estimation::RobotSetup> fleet() {
  estimation::RobotSetup r1, r2;
  r1.name = "r1";
  r1.initial_pose = Pose2{1.0, 2.0, 0.5};
  r2.name = "r2";
  r1.body.radius_m = r2.body.radius_m = 0.15;
  r1.body.height_m = r2.body.height_m = 0.3;
  r1.body.wheel_separation_m = r2.body.wheel_separation_m = 0.26;
  return {r1, r2};
}

Objects frame(const std::string& robot, TimeNs time, std::uint32_t sequence = 0) {
  Objects objects;
  objects.robot = robot;
  objects.acquired_ns = time;
  objects.sequence = sequence;
  return objects;
}

Measurement pose(const std::string& robot, TimeNs time, const Eigen::Vector3d& value) {
  Measurement m;
  m.source = "ceiling/c1";
  m.to = robot;
  m.acquired_ns = time;
  m.value = value;
  m.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
  return m;
}

TEST(EstimatorStage, ReturnsOnePosePerFrameInOrder) {
  EstimatorStage stage(fleet(), {});
  const Objects a = frame("r2", 100, 7), b = frame("unlisted", 100, 8), c = frame("r1", 100, 9);
  const auto poses = stage.process(100, {&a, &b, &c}, {});
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_EQ(poses[0].robot, "r2");
  EXPECT_FALSE(poses[0].valid);  // no initial pose, no measurement
  EXPECT_EQ(poses[1].robot, "unlisted");
  EXPECT_FALSE(poses[1].valid);
  EXPECT_EQ(poses[1].sequence, 8U);
  EXPECT_TRUE(poses[2].valid);
  EXPECT_NEAR(poses[2].map_from_base.x_m, 1.0, 1e-9);  // the prior is the only information
  EXPECT_EQ(poses[2].sequence, 9U);
  EXPECT_EQ(stage.rejectedFrames(), 1U);
  EXPECT_EQ(stage.status("r2").code, ErrorCode::kNotLocalized);
  EXPECT_EQ(stage.status("r1").code, ErrorCode::kNone);
}

TEST(EstimatorStage, CountsAndIgnoresInvalidMeasurements) {
  EstimatorStage stage(fleet(), {});
  const Objects f = frame("r2", 100);
  const Measurement nan = pose("r2", 100, {kNan, 0, 0}), unknown = pose("r9", 100, {0, 0, 0});
  Measurement flat = pose("r2", 100, {0, 0, 0}), lopsided = flat, range = flat;
  flat.covariance.setZero();
  lopsided.covariance(0, 1) = 1.0;  // not symmetric, not positive
  range.kind = MeasurementKind::kRangeBearing;
  range.from = "r1";
  range.value.x() = -1.0;
  const auto poses = stage.process(100, {&f}, {&nan, &unknown, &flat, &lopsided, &range});
  EXPECT_EQ(stage.rejectedMeasurements(), 5U);
  EXPECT_FALSE(poses[0].valid);
  const Objects g = frame("r2", 200);
  const Measurement good = pose("r2", 200, {0.3, 0.4, 3.0});
  const auto localized = stage.process(200, {&g}, {&good});
  ASSERT_TRUE(localized[0].valid);
  EXPECT_NEAR(localized[0].map_from_base.y_m, 0.4, 1e-6);
}

TEST(EstimatorStage, EstimatesPoseForInvalidFrame) {
  EstimatorStage stage(fleet(), {});
  Objects first = frame("r1", 0), second = frame("r1", 100000000);
  stage.process(0, {&first}, {});
  second.state = FrameState::kDark;
  second.motion.valid = true;
  second.motion.since_ns = 0;
  second.motion.left_m = second.motion.right_m = 0.05;
  second.motion.previous_from_current = {0.05, 0.0, 0.0};
  second.motion.covariance = 1e-6 * Eigen::Matrix3d::Identity();
  const auto poses = stage.process(100000000, {&second}, {});
  ASSERT_TRUE(poses[0].valid);
  EXPECT_NEAR(poses[0].map_from_base.x_m, 1.0 + 0.05 * std::cos(0.5), 1e-6);
  EXPECT_NEAR(poses[0].map_from_base.y_m, 2.0 + 0.05 * std::sin(0.5), 1e-6);
}

TEST(EstimatorStage, FollowsCeilingCameraAfterKidnapping) {
  EstimatorStage stage(fleet(), {});
  std::vector<PoseEstimate> poses;
  for (int i = 0; i < 8; ++i) {
    const TimeNs time = i * 100000000LL;
    Objects f = frame("r1", time);
    f.motion.valid = i > 0;
    f.motion.since_ns = time - 100000000LL;
    f.motion.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    // Kidnapped by half a metre between frames 3 and 4, without wheel motion.
    const Measurement m = pose("r1", time, {i < 4 ? 1.0 : 1.5, 2.0, 0.5});
    poses = stage.process(time, {&f}, {&m});
    if (i == 4) {
      EXPECT_NEAR(poses[0].map_from_base.x_m, 1.0, 0.01);  // one measurement is not enough
    }
  }
  EXPECT_NEAR(poses[0].map_from_base.x_m, 1.5, 0.01);
  EXPECT_EQ(stage.estimator().status("r1").losses, 1);
}

}  // namespace
}  // namespace omnifleet::localizer
