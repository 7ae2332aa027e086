#include "scan/keyframe_graph.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

namespace omnifleet::scan {
namespace {

Eigen::Matrix3d covariance(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

Pose2 noisy(const Pose2& pose, const Eigen::Matrix3d& covariance, std::mt19937& random) {
  std::normal_distribution<double> noise(0.0, 1.0);
  const Eigen::Vector3d s = covariance.diagonal().cwiseSqrt();
  return pose * Pose2{s.x() * noise(random), s.y() * noise(random), s.z() * noise(random)};
}

/// A square loop of keyframes.
std::vector<Pose2> loop(int per_side) {
  std::vector<Pose2> poses;
  Pose2 pose;
  for (int side = 0; side < 4; ++side) {
    for (int k = 0; k < per_side; ++k) {
      poses.push_back(pose);
      pose = pose * Pose2{0.25, 0.0, 0.0};
    }
    pose = pose * Pose2{0.0, 0.0, M_PI / 2.0};
  }
  return poses;
}

TEST(KeyframeGraph, RecoversExactPosesFromExactConstraints) {
  const std::vector<Pose2> truth = loop(8);
  std::mt19937 random(1);
  KeyframeGraph graph;
  for (const Pose2& pose : truth) graph.add(noisy(pose, covariance(0.1, 0.1), random));
  graph.addAbsolute(0, truth[0], covariance(0.001, 0.001));
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const std::size_t next = (k + 1) % truth.size();
    graph.addRelative(static_cast<KeyframeGraph::Id>(k), static_cast<KeyframeGraph::Id>(next),
                      truth[k].inverse() * truth[next], covariance(0.01, 0.01));
  }
  graph.optimise();
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const Pose2 off = truth[k].inverse() * graph.pose(static_cast<KeyframeGraph::Id>(k));
    EXPECT_LT(off.translation().norm(), 1e-5) << k;
    EXPECT_LT(std::abs(wrapAngle(off.theta_rad)), 1e-5) << k;
  }
}

TEST(KeyframeGraph, CovarianceMatchesTheErrors) {
  const std::vector<Pose2> truth = loop(5);
  const Eigen::Matrix3d step = covariance(0.004, 0.004), start = covariance(0.005, 0.005);
  double sum = 0.0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    std::mt19937 random(static_cast<unsigned>(run));
    KeyframeGraph graph;
    graph.addAbsolute(graph.add(truth[0]), noisy(truth[0], start, random), start);
    for (std::size_t k = 1; k < truth.size(); ++k) {
      const Pose2 measured = noisy(truth[k - 1].inverse() * truth[k], step, random);
      const auto id = graph.add(graph.pose(static_cast<KeyframeGraph::Id>(k - 1)) * measured);
      graph.addRelative(id - 1, id, measured, step);
    }
    graph.addRelative(static_cast<KeyframeGraph::Id>(truth.size() - 1), 0,
                      noisy(truth.back().inverse() * truth[0], step, random), step);
    graph.optimise();
    const KeyframeGraph::Id middle = 10;
    const Pose2 off = truth[middle].inverse() * graph.pose(middle);
    const Eigen::Vector3d e(off.x_m, off.y_m, wrapAngle(off.theta_rad));
    sum += e.dot(graph.covariance(middle).inverse() * e);
  }
  EXPECT_NEAR(sum / kRuns, 3.0, 0.6);  // mean of χ² with 3 degrees; σ of the mean is 0.17
}

TEST(KeyframeGraph, OneWrongLoopClosureMovesLittle) {
  const std::vector<Pose2> truth = loop(8);
  KeyframeGraph graph;
  for (const Pose2& pose : truth) graph.add(pose);
  graph.addAbsolute(0, truth[0], covariance(0.001, 0.001));
  for (std::size_t k = 0; k < truth.size(); ++k) {
    for (std::size_t far = 1; far <= 4; ++far) {
      const std::size_t next = (k + far) % truth.size();
      graph.addRelative(static_cast<KeyframeGraph::Id>(k), static_cast<KeyframeGraph::Id>(next),
                        truth[k].inverse() * truth[next], covariance(0.003, 0.003));
    }
  }
  graph.addRelative(4, 20, Pose2{0.0, 0.0, 0.0}, covariance(0.003, 0.003));  // metres off
  graph.optimise();
  for (std::size_t k = 0; k < truth.size(); ++k)
    EXPECT_LT((truth[k].translation() - graph.pose(static_cast<KeyframeGraph::Id>(k)).translation()).norm(),
              0.005);
}

TEST(KeyframeGraph, GivesTheSameBitsTwice) {
  const auto run = [] {
    std::mt19937 random(3);
    const std::vector<Pose2> truth = loop(6);
    KeyframeGraph graph;
    for (const Pose2& pose : truth) graph.add(noisy(pose, covariance(0.02, 0.02), random));
    graph.addAbsolute(0, truth[0], covariance(0.01, 0.01));
    for (std::size_t k = 1; k < truth.size(); ++k)
      graph.addRelative(static_cast<KeyframeGraph::Id>(k - 1), static_cast<KeyframeGraph::Id>(k),
                        noisy(truth[k - 1].inverse() * truth[k], covariance(0.01, 0.01), random),
                        covariance(0.01, 0.01));
    graph.optimise();
    std::vector<double> values;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const Pose2& pose = graph.pose(static_cast<KeyframeGraph::Id>(k));
      values.insert(values.end(), {pose.x_m, pose.y_m, pose.theta_rad});
    }
    return values;
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace omnifleet::scan
