#include "tracking/assignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

namespace omnifleet::tracking {
namespace {

double priceOf(const Eigen::MatrixXd& cost, const std::vector<int>& columns, double gate) {
  double price = 0.0;
  for (std::size_t r = 0; r < columns.size(); ++r) {
    price += columns[r] < 0 ? gate : cost(static_cast<Eigen::Index>(r), columns[r]);
  }
  return price;
}

/// Minimum price over all ways to give each row one column or none.
double bruteForce(const Eigen::MatrixXd& cost, double gate) {
  const auto rows = static_cast<std::size_t>(cost.rows()), columns = static_cast<std::size_t>(cost.cols());
  std::vector<int> slots(rows + columns, -1);  // the columns, and one "unassigned" per row
  std::iota(slots.begin(), slots.begin() + static_cast<std::ptrdiff_t>(columns), 0);
  std::sort(slots.begin(), slots.end());
  double best = std::numeric_limits<double>::infinity();
  do {
    const std::vector<int> chosen(slots.begin(), slots.begin() + static_cast<std::ptrdiff_t>(rows));
    best = std::min(best, priceOf(cost, chosen, gate));
  } while (std::next_permutation(slots.begin(), slots.end()));
  return best;
}

TEST(Assign, FindsTheCheapestAssignment) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> uniform(0.0, 2.0);
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::MatrixXd cost(1 + trial % 4, 1 + (trial / 4) % 4);
    for (Eigen::Index i = 0; i < cost.size(); ++i) cost.data()[i] = uniform(rng);
    const auto columns = assign(cost, 1.0);
    EXPECT_NEAR(priceOf(cost, columns, 1.0), bruteForce(cost, 1.0), 1e-12);  // rounding of a few sums
    for (std::size_t r = 0; r < columns.size(); ++r) {
      if (columns[r] < 0) continue;
      EXPECT_LT(cost(static_cast<Eigen::Index>(r), columns[r]), 1.0);
      EXPECT_EQ(std::count(columns.begin(), columns.end(), columns[r]), 1);
    }
  }
}

TEST(Assign, NeverUsesAForbiddenPair) {
  constexpr double kNo = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd cost(2, 2);
  cost << kNo, 0.5, kNo, 0.1;
  EXPECT_EQ(assign(cost, 1.0), (std::vector<int>{-1, 1}));
}

TEST(Assign, ReturnsNoPairsForEmptyInput) {
  EXPECT_TRUE(assign(Eigen::MatrixXd(0, 3), 1.0).empty());
  EXPECT_EQ(assign(Eigen::MatrixXd(2, 0), 1.0), (std::vector<int>{-1, -1}));
}

}  // namespace
}  // namespace omnifleet::tracking
