#include "evaluation/assignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

namespace omnifleet::evaluation {
namespace {

const double kInfinity = std::numeric_limits<double>::infinity();

struct Best {
  int pairs = -1;
  double cost = 0.0;
};

/// Tries every assignment of columns (or none) to rows. The most pairs win, then the least cost.
void search(const Eigen::MatrixXd& cost, Eigen::Index row, std::vector<bool>& used, int pairs, double sum,
            Best& best) {
  if (row == cost.rows()) {
    if (pairs > best.pairs || (pairs == best.pairs && sum < best.cost)) best = {pairs, sum};
    return;
  }
  search(cost, row + 1, used, pairs, sum, best);
  for (Eigen::Index j = 0; j < cost.cols(); ++j) {
    if (used[j] || cost(row, j) == kInfinity) continue;
    used[j] = true;
    search(cost, row + 1, used, pairs + 1, sum + cost(row, j), best);
    used[j] = false;
  }
}

Best value(const Eigen::MatrixXd& cost, const std::vector<int>& column_of) {
  Best result{0, 0.0};
  std::vector<bool> used(static_cast<std::size_t>(cost.cols()), false);
  for (std::size_t i = 0; i < column_of.size(); ++i) {
    if (column_of[i] < 0) continue;
    EXPECT_FALSE(used[column_of[i]]) << "a column is assigned twice";
    used[column_of[i]] = true;
    ++result.pairs;
    result.cost += cost(static_cast<Eigen::Index>(i), column_of[i]);
  }
  return result;
}

TEST(Assign, MatchesBruteForce) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1.0, 3.0);
  for (int trial = 0; trial < 600; ++trial) {
    const int rows = 1 + static_cast<int>(random() % 5), columns = 1 + static_cast<int>(random() % 5);
    Eigen::MatrixXd cost(rows, columns);
    for (double& c : cost.reshaped()) c = random() % 3 == 0 ? kInfinity : number(random);
    Best best;
    std::vector<bool> used(static_cast<std::size_t>(columns), false);
    search(cost, 0, used, 0, 0.0, best);
    const Best got = value(cost, assign(cost));
    EXPECT_EQ(got.pairs, best.pairs) << cost;
    EXPECT_NEAR(got.cost, best.cost, 1e-12) << cost;
  }
}

TEST(Assign, MinimisesTotalCostNotSingleCosts) {
  Eigen::MatrixXd cost(2, 2);
  cost << 1.0, 2.0, 1.1, 9.0;
  EXPECT_EQ(assign(cost), (std::vector<int>{1, 0}));
}

TEST(Assign, FindsKnownOptimumOfLargeProblem) {
  // Costs u_i + v_j + (0 on a permutation, positive elsewhere) have this permutation as the optimum.
  std::mt19937 random(9);
  std::uniform_real_distribution<double> number(0.0, 1.0);
  const int n = 120;
  std::vector<int> permutation(n);
  std::iota(permutation.begin(), permutation.end(), 0);
  std::shuffle(permutation.begin(), permutation.end(), random);
  const Eigen::VectorXd u = Eigen::VectorXd::Random(n), v = Eigen::VectorXd::Random(n);
  Eigen::MatrixXd cost(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j)
      cost(i, j) = u(i) + v(j) + (permutation[i] == j ? 0.0 : 0.001 + number(random));
  }
  EXPECT_EQ(assign(cost), permutation);
}

TEST(Assign, LeavesForbiddenRowsUnassigned) {
  EXPECT_TRUE(assign(Eigen::MatrixXd(0, 3)).empty());
  EXPECT_EQ(assign(Eigen::MatrixXd(2, 0)), (std::vector<int>{-1, -1}));
  EXPECT_EQ(assign(Eigen::MatrixXd::Constant(2, 3, kInfinity)), (std::vector<int>{-1, -1}));
  Eigen::MatrixXd nan(1, 1);
  nan << std::nan("");
  EXPECT_THROW(assign(nan), std::invalid_argument);
}

}  // namespace
}  // namespace omnifleet::evaluation
