// The σ of the common heading of all poses and points, which no measurement determines.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "estimation/factors.h"
#include "estimation/map_frame.h"

namespace omnifleet::estimation {
namespace {

/// σ of a heading with a prior of 1 rad only, after marginalisation of two poses at different linearisation
/// points.
double headingSigma(Graph& graph) {
  const std::vector<Pose2> poses = {{0.0, 0.0, 0.0}, {0.5, 0.2, 0.4}, {1.0, 0.5, 0.9}};
  const std::vector<Eigen::Vector2d> points = {{2.0, 1.0}, {-1.0, 1.5}, {0.5, -1.8}};
  std::vector<VariableId> p, l;
  for (const Pose2& pose : poses) p.push_back(graph.addVariable(pose.vector()));
  for (const Eigen::Vector2d& point : points) l.push_back(graph.addVariable(point));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t k = 0; k < points.size(); ++k)
      graph.addFactor(pointInBaseFactor(poses[i].inverse() * points[k], 0.02), {p[i], l[k]});
    if (i > 0)
      graph.addFactor(
          relativePoseFactor(poses[i - 1].inverse() * poses[i], 1e-4 * Eigen::Matrix3d::Identity()),
          {p[i - 1], p[i]});
  }
  for (const std::size_t oldest : {0U, 1U}) {
    for (std::size_t i = oldest; i < poses.size(); ++i)
      graph.value(p[i]) +=
          Eigen::Vector3d(0.05 * std::cos(i + oldest), 0.05 * std::sin(3.0 * i), 0.1 * oldest);
    for (std::size_t k = 0; k < points.size(); ++k)
      graph.value(l[k]) += 0.2 * Eigen::Vector2d(std::sin(2.0 * k + oldest), std::cos(5.0 * k - oldest));
    graph.marginalise({p[oldest]});
  }
  graph.addFactor(priorFactor(graph.value(l[0]), Eigen::Vector2d::Constant(1e-3)), {l[0]});
  graph.addFactor(priorFactor(graph.value(p[2]), Eigen::Vector3d(1e3, 1e3, 1.0)), {p[2]});
  return std::sqrt(graph.covariance({p[2]})(2, 2));
}

TEST(MapFrame, MarginalisationKeepsTheSigmaOfTheCommonHeading) {
  Graph graph, naive;
  graph.setMotions(commonMotions);
  EXPECT_NEAR(headingSigma(graph), 1.0, 1e-4);
  EXPECT_LT(headingSigma(naive), 0.9);  // inconsistent: by changes of the linearisation point alone
}

TEST(MapFrame, FleetWithAMapOfItsOwnKeepsTheSigmaOfTheCommonHeading) {
  for (const bool founded : {true, false}) {
    RobotSetup setup;
    setup.name = "r1";
    FleetState fleet({setup}, {});
    Objects frame;
    frame.acquired_ns = 1'000'000'000;
    RobotNode& robot = *fleet.find("r1");
    fleet.place(robot, frame, Pose2{});
    const VariableId pose = robot.window.back().pose;
    const Eigen::Matrix3d covariance = 1e-4 * Eigen::Matrix3d::Identity();
    if (founded)
      foundMap(fleet, pose, Pose2{}, covariance);
    else
      fleet.graph.addFactor(absolutePoseFactor(Pose2{}, covariance), {pose});
    fleet.detector(robot);
    if (founded)
      EXPECT_NEAR(headingSigma(fleet.graph), 1.0, 1e-4);
    else
      EXPECT_LT(headingSigma(fleet.graph), 0.9);
  }
}

}  // namespace
}  // namespace omnifleet::estimation
