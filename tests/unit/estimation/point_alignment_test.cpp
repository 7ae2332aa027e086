// Named points locate a robot relative to them. They do not reduce the σ of the heading of the map.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/factors.h"
#include "estimation/fleet_state.h"
#include "estimation/point_alignment.h"

namespace omnifleet::estimation {
namespace {

constexpr double kMapHeadingSigma_rad = 0.2;

class PointAlignment : public ::testing::Test {
 protected:
  PointAlignment() : fleet_({setup("r1"), setup("r2")}, {}) {
    frame_.acquired_ns = 1'000'000'000;
    founder().covariance = Eigen::Vector3d(0.01, 0.01, kMapHeadingSigma_rad).cwiseAbs2().asDiagonal();
    fleet_.place(founder(), frame_, Pose2{});
    fleet_.graph.addFactor(absolutePoseFactor(Pose2{}, founder().covariance), {pose(founder())});
    int name = 0;
    for (const Eigen::Vector2d& at : places_) {
      Point& point = fleet_.points[std::to_string(++name)];
      point.variable = fleet_.graph.addVariable(at);
      fleet_.graph.addFactor(pointInBaseFactor(at, 0.05), {pose(founder()), point.variable});
    }
    unlocalized().scout.emplace();
    unlocalized().scout->time_ns = frame_.acquired_ns;
    name = 0;
    for (const Eigen::Vector2d& at : places_)
      addScoutPair(unlocalized(), std::to_string(++name), truth_.inverse() * at, at,
                   0.0025 * Eigen::Matrix2d::Identity());
  }

  static RobotSetup setup(const std::string& name) {
    RobotSetup robot;
    robot.name = name;
    return robot;
  }
  RobotNode& founder() { return *fleet_.find("r1"); }
  RobotNode& unlocalized() { return *fleet_.find("r2"); }
  static VariableId pose(const RobotNode& robot) { return robot.window.back().pose; }
  double mapHeadingSigma() const {
    return std::sqrt(fleet_.graph.covariance({fleet_.find("r1")->window.back().pose})(2, 2));
  }

  const std::vector<Eigen::Vector2d> places_ = {
      {2.0, 1.0}, {-1.0, 1.5}, {0.5, -1.8}, {1.5, -1.0}, {-1.6, -0.4}};
  const Pose2 truth_{1.0, -0.5, 0.7};
  FleetState fleet_;
  Objects frame_;
};

TEST_F(PointAlignment, LocatesTheRobot) {
  ASSERT_TRUE(locateByPoints(fleet_, unlocalized(), frame_));
  fleet_.graph.solve(20);
  const Pose2 found = fleet_.pose(pose(unlocalized()));
  EXPECT_NEAR(found.x_m, truth_.x_m, 1e-3);
  EXPECT_NEAR(found.y_m, truth_.y_m, 1e-3);
  EXPECT_NEAR(found.theta_rad, truth_.theta_rad, 1e-3);
}

TEST_F(PointAlignment, DoesNotReduceTheSigmaOfTheMapHeading) {
  ASSERT_NEAR(mapHeadingSigma(), kMapHeadingSigma_rad, 1e-6);
  ASSERT_TRUE(locateByPoints(fleet_, unlocalized(), frame_));
  int name = 0;
  for (const Eigen::Vector2d& at : places_)  // its observations of them from there
    fleet_.graph.addFactor(pointInBaseFactor(truth_.inverse() * at, 0.05),
                           {pose(unlocalized()), fleet_.points.at(std::to_string(++name)).variable});
  EXPECT_NEAR(mapHeadingSigma(), kMapHeadingSigma_rad, 1e-3);
}

}  // namespace
}  // namespace omnifleet::estimation
