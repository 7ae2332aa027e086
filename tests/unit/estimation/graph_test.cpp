// Marginalisation and covariance against the whole problem solved in closed form.

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "estimation/factors.h"
#include "estimation/graph.h"

namespace omnifleet::estimation {
namespace {

Eigen::VectorXd scalar(double x) {
  return Eigen::VectorXd::Constant(1, x);
}

/// to − from = measured, σ.
std::unique_ptr<ceres::CostFunction> difference(double measured, double sigma) {
  Eigen::MatrixXd s(1, 2);
  s << -1.0 / sigma, 1.0 / sigma;
  return std::make_unique<DensePrior>(s, scalar(-measured / sigma),
                                      std::vector<Eigen::VectorXd>{scalar(0), scalar(0)});
}

TEST(Graph, ChainHasMeansAndVariancesOfSums) {
  Graph graph;
  const auto a = graph.addVariable(scalar(5)), b = graph.addVariable(scalar(-3)),
             c = graph.addVariable(scalar(9));
  graph.addFactor(priorFactor(scalar(1.0), scalar(0.1)), {a});
  graph.addFactor(difference(2.0, 0.2), {a, b});
  graph.addFactor(difference(3.0, 0.3), {b, c});
  graph.solve(10);
  EXPECT_NEAR(graph.value(c)(0), 6.0, 1e-6);  // tolerance for the damping of Levenberg–Marquardt
  EXPECT_NEAR(graph.covariance({c})(0, 0), 0.01 + 0.04 + 0.09, 1e-8);
  EXPECT_NEAR(graph.covariance({b, c})(0, 1), 0.01 + 0.04, 1e-8);
}

TEST(Graph, MarginalisationIsExactForLinearProblems) {
  const auto build = [](Graph& graph, std::vector<VariableId>& v) {
    for (int i = 0; i < 6; ++i) v.push_back(graph.addVariable(scalar(0.3 * i * i)));
    graph.addFactor(priorFactor(scalar(1.0), scalar(0.5)), {v[0]});
    for (int i = 0; i < 5; ++i)
      graph.addFactor(difference(1.0 + 0.1 * i, 0.2),
                      {v[static_cast<std::size_t>(i)], v[static_cast<std::size_t>(i + 1)]});
    graph.addFactor(difference(2.5, 0.3), {v[0], v[3]});
    graph.addFactor(difference(3.9, 0.4), {v[1], v[5]});
  };
  Graph whole, part;
  std::vector<VariableId> v, w;
  build(whole, v);
  build(part, w);
  part.marginalise({w[0], w[1]});
  part.marginalise({w[2]});
  EXPECT_EQ(part.variableCount(), 3U);
  whole.solve(20);
  part.solve(20);
  for (std::size_t i = 3; i < 6; ++i)
    EXPECT_NEAR(whole.value(v[i])(0), part.value(w[i])(0), 2e-6) << i;  // damping again
  EXPECT_NEAR(whole.covariance({v[5]})(0, 0), part.covariance({w[5]})(0, 0), 1e-8);
}

TEST(Graph, SlidingWindowKeepsTheCovarianceOfDeadReckoning) {
  // Covariances of the newest pose with and without a window must agree.
  const Eigen::Matrix3d step = Eigen::Vector3d(1e-6, 4e-7, 3e-5).asDiagonal();
  const auto covariance = [&](std::size_t window) {
    Graph graph;
    const auto bias = graph.addVariable(WheelModel::Zero());
    graph.addFactor(priorFactor(WheelModel::Zero(), WheelModel(0.02, 0.02, 1e-3, 1e-3, 1e-3)), {bias});
    std::vector<VariableId> poses;
    Pose2 at{0.3, -0.2, 1.0};
    poses.push_back(graph.addVariable(at.vector()));
    graph.addFactor(absolutePoseFactor(at, 1e-4 * Eigen::Matrix3d::Identity()), {poses.back()});
    for (int i = 0; i < 12; ++i) {
      const double left = 0.05 + 0.01 * (i % 3), right = 0.06 - 0.008 * (i % 4);
      const Pose2 motion = arc(left, right, 0.26);
      at = at * motion;
      const auto next = graph.addVariable(at.vector());
      graph.value(next)(2) = graph.value(poses.back())(2) + motion.theta_rad;
      WheelJacobian by_model = WheelJacobian::Zero();
      by_model.leftCols<2>() = arcBiasJacobian(left, right, 0.26);
      graph.addFactor(motionFactor(motion, step, by_model), {poses.back(), next, bias});
      poses.push_back(next);
      if (poses.size() > window) {
        graph.marginalise({poses.front()});
        poses.erase(poses.begin());
      }
    }
    return graph.covariance({poses.back(), bias});
  };
  const Eigen::MatrixXd whole = covariance(100), part = covariance(3);
  EXPECT_LT((whole - part).cwiseAbs().maxCoeff(), 1e-6 * whole.cwiseAbs().maxCoeff());
}

TEST(Graph, CauchyKernelSuppressesAnOutlier) {
  Graph graph;
  const auto a = graph.addVariable(scalar(0));
  for (int i = 0; i < 5; ++i) graph.addFactor(priorFactor(scalar(1.0 + 0.01 * i), scalar(0.05)), {a}, 2.0);
  graph.addFactor(priorFactor(scalar(50.0), scalar(0.05)), {a}, 2.0);
  graph.solve(50);
  // The gradient of Cauchy's loss at 980 σ is 4/980 σ⁻¹, against 5 σ⁻² per σ: below a tenth of a millimetre.
  EXPECT_NEAR(graph.value(a)(0), 1.02, 1e-3);
}

/// A chain of scalars. condense() keeps the last two; extend() adds one more.
struct Chain {
  Graph graph;
  std::vector<VariableId> v;
  FactorId old = kNoFactor, left_out = kNoFactor;
  Chain() {
    for (int i = 0; i < 5; ++i) v.push_back(graph.addVariable(scalar(0.3 * i * i)));
    graph.addFactor(priorFactor(scalar(1.0), scalar(0.5)), {v[0]});
    for (std::size_t i = 0; i < 4; ++i) old = graph.addFactor(difference(1.0, 0.2), {v[i], v[i + 1]});
    graph.addFactor(difference(2.5, 0.3), {v[0], v[3]});
    left_out = graph.addFactor(priorFactor(scalar(9.0), scalar(0.1)), {v[4]});
  }
  void condense() { graph.condense({v[3], v[4]}, {left_out}); }
  void extend() {
    graph.removeFactor(left_out);
    v.push_back(graph.addVariable(scalar(-2.0)));
    graph.addFactor(difference(0.7, 0.2), {v[4], v[5]});
    graph.addFactor(priorFactor(scalar(6.0), scalar(0.3)), {v[5]});
    graph.addFactor(difference(1.6, 0.3), {v[3], v[5]});
  }
};

TEST(Graph, SolveNewestAgreesWithSolvingTheWholeGraph) {
  Chain whole, quick;
  quick.condense();
  whole.extend();
  quick.extend();
  whole.graph.solve(20);
  ASSERT_TRUE(quick.graph.solveNewest(1));
  for (std::size_t i = 3; i < 6; ++i)
    EXPECT_NEAR(whole.graph.value(whole.v[i])(0), quick.graph.value(quick.v[i])(0), 2e-6) << i;  // damping
  EXPECT_EQ(quick.graph.value(quick.v[0])(0), 0.0);  // unchanged until solve()
  const Eigen::MatrixXd expected = whole.graph.covariance({whole.v[5], whole.v[3]});
  EXPECT_LT((expected - quick.graph.newestCovariance({quick.v[5], quick.v[3]})).norm(), 1e-8);
}

TEST(Graph, SolveNewestFailsAfterChangesOfTheCondensedPart) {
  Chain none, removed, outside, marginalised;
  none.extend();
  EXPECT_FALSE(none.graph.solveNewest(3));
  for (Chain* chain : {&removed, &outside, &marginalised}) {
    chain->condense();
    chain->extend();
  }
  removed.graph.removeFactor(removed.old);
  EXPECT_FALSE(removed.graph.solveNewest(3));
  outside.graph.addFactor(difference(4.0, 0.3), {outside.v[1], outside.v[5]});
  EXPECT_FALSE(outside.graph.solveNewest(3));
  marginalised.graph.marginalise({marginalised.v[0]});
  EXPECT_FALSE(marginalised.graph.solveNewest(3));
  EXPECT_EQ(marginalised.graph.value(marginalised.v[5])(0), -2.0);
}

TEST(Graph, MarginalisationRemovesFactorsWithoutRemainingVariables) {
  Graph graph;
  const auto a = graph.addVariable(scalar(0)), b = graph.addVariable(scalar(1));
  graph.addFactor(priorFactor(scalar(1.0), scalar(0.1)), {a});
  const auto kept = graph.addFactor(priorFactor(scalar(2.0), scalar(0.1)), {b});
  graph.marginalise({a});
  EXPECT_EQ(graph.factorCount(), 1U);
  EXPECT_TRUE(graph.hasFactor(kept));
}

}  // namespace
}  // namespace omnifleet::estimation
