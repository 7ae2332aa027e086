// Motion of a robot from frame to frame by the texture of the floor, against the true motion of rendered
// images.

#include "local_mapper/floor_odometry.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "tests/unit/ground/textured_floor.h"

namespace omnifleet::local_mapper {
namespace {

using ground::testing::FloorLook;
using ground::testing::FloorTexture;
using ground::testing::texturedFloor;

constexpr TimeNs kFloorPeriod_ns = 200'000'000;

FloorOdometry floorOdometry() {
  return {texturedFloor().camera, texturedFloor().view, {}};
}

struct FloorDrive {
  std::vector<FloorMotion> motions;  ///< of each frame
  double worst_m = 0.0, worst_rad = 0.0, nees = 0.0;
  int valid = 0;
};

/// @param wheels whether wheels, 4 % off, predict each step
FloorDrive driveOnFloor(const FloorLook& look, bool wheels, int frames = 20) {
  const FloorTexture texture(0.008, 5);
  const Pose2 step{0.05, 0.004, 0.07};
  FloorOdometry odometry = floorOdometry();
  FloorDrive drive;
  Pose2 pose;
  for (int k = 0; k < frames; ++k) {
    Motion predicted;
    const TimeNs time = k * kFloorPeriod_ns;
    predicted.valid = wheels && k > 0;
    predicted.since_ns = time - kFloorPeriod_ns;
    predicted.previous_from_current = {1.04 * step.x_m, 0.0, 0.96 * step.theta_rad};
    if (k > 0) pose = pose * step;
    drive.motions.push_back(odometry.add(
        time, texturedFloor().image(texture, pose, look, static_cast<unsigned>(k + 1)), {}, predicted));
    const FloorMotion& motion = drive.motions.back();
    if (!motion.valid) continue;
    const Pose2 error = motion.previous_from_current.inverse() * step;
    const Eigen::Vector3d e = error.vector();
    ++drive.valid;
    drive.worst_m = std::max(drive.worst_m, error.translation().norm());
    drive.worst_rad = std::max(drive.worst_rad, std::abs(error.theta_rad));
    drive.nees += e.dot(motion.covariance.inverse() * e);
  }
  drive.nees /= std::max(1, drive.valid);
  return drive;
}

TEST(FloorOdometry, MeasuresEachStepWithoutWheels) {
  const FloorDrive drive = driveOnFloor({}, false);
  EXPECT_FALSE(drive.motions.front().valid);
  EXPECT_GE(drive.valid, 14);  // the first ones may rest on a pattern that is fixed in the image
  EXPECT_LT(drive.worst_m, 1e-3);
  EXPECT_LT(drive.worst_rad, 1e-3);
  EXPECT_LT(drive.nees, 6.0);
}

TEST(FloorOdometry, MeasuresEachStepThatWheelsPredict) {
  const FloorDrive drive = driveOnFloor({}, true);
  EXPECT_GE(drive.valid, 17);
  EXPECT_LT(drive.worst_m, 1e-3);
  EXPECT_LT(drive.worst_rad, 1e-3);
  EXPECT_LT(drive.nees, 6.0);
  EXPECT_GT(drive.nees, 0.1);
}

TEST(FloorOdometry, NamesTheFrameThatEachMotionStartsFrom) {
  const FloorDrive drive = driveOnFloor({}, true, 6);
  for (std::size_t k = 1; k < drive.motions.size(); ++k)
    EXPECT_EQ(drive.motions[k].since_ns, static_cast<TimeNs>(k - 1) * kFloorPeriod_ns) << k;
}

TEST(FloorOdometry, MeasuresNothingAcrossAGap) {
  const FloorTexture texture(0.008, 5);
  FloorOdometry odometry = floorOdometry();
  const auto add = [&](unsigned k) {
    Motion wheels;
    wheels.valid = k > 0;
    wheels.since_ns = (k - 1) * kFloorPeriod_ns;
    wheels.previous_from_current = {0.06, 0.0, 0.0};
    return odometry.add(k * kFloorPeriod_ns, texturedFloor().image(texture, {0.06 * k, 0.0, 0.0}, {}, k + 1),
                        {}, wheels);
  };
  for (unsigned k = 0; k < 6; ++k) add(k);
  EXPECT_TRUE(add(6).valid);
  odometry.forget();
  EXPECT_FALSE(add(7).valid);
  EXPECT_TRUE(add(8).valid);
}

TEST(FloorOdometry, SaysNothingOnPlainFloor) {
  FloorLook plain;
  plain.contrast = 0.0;
  EXPECT_EQ(driveOnFloor(plain, false).valid, 0);
  EXPECT_EQ(driveOnFloor(plain, true).valid, 0);
}

TEST(FloorOdometryOptions, AutomaticallyForRobotsWithoutWheels) {
  FloorOdometryOptions o;
  EXPECT_TRUE(o.isUsed(false));
  EXPECT_FALSE(o.isUsed(true));
  o.use = "always";
  EXPECT_TRUE(o.isUsed(true));
  o.use = "never";
  EXPECT_FALSE(o.isUsed(false));
}

}  // namespace
}  // namespace omnifleet::local_mapper
