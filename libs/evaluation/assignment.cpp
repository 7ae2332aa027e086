#include "evaluation/assignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace omnifleet::evaluation {
namespace {

/// Rows ≤ columns, all finite. The classic algorithm with 1-based helpers: row `i` is added by the cheapest
/// alternating path, u and v are the dual potentials.
std::vector<int> solve(const Eigen::MatrixXd& cost) {
  const int n = static_cast<int>(cost.rows()), m = static_cast<int>(cost.cols());
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> u(n + 1, 0.0), v(m + 1, 0.0);
  std::vector<int> row_of(m + 1, 0), previous(m + 1, 0);
  for (int i = 1; i <= n; ++i) {
    row_of[0] = i;
    int column = 0;
    std::vector<double> slack(m + 1, infinity);
    std::vector<bool> used(m + 1, false);
    do {
      used[column] = true;
      const int row = row_of[column];
      int best = 0;
      double delta = infinity;
      for (int j = 1; j <= m; ++j) {
        if (used[j]) continue;
        const double reduced = cost(row - 1, j - 1) - u[row] - v[j];
        if (reduced < slack[j]) {
          slack[j] = reduced;
          previous[j] = column;
        }
        if (slack[j] < delta) {
          delta = slack[j];
          best = j;
        }
      }
      for (int j = 0; j <= m; ++j) {
        if (used[j]) {
          u[row_of[j]] += delta;
          v[j] -= delta;
        } else {
          slack[j] -= delta;
        }
      }
      column = best;
    } while (row_of[column] != 0);
    for (; column != 0; column = previous[column]) row_of[column] = row_of[previous[column]];
  }
  std::vector<int> column_of(n, -1);
  for (int j = 1; j <= m; ++j) {
    if (row_of[j] > 0) column_of[row_of[j] - 1] = j - 1;
  }
  return column_of;
}

/// Forbidden pairs get a price above any sum of allowed ones, so they are used only where nothing else is
/// left.
Eigen::MatrixXd priced(const Eigen::MatrixXd& cost) {
  double low = 0.0, high = 0.0;
  for (const double c : cost.reshaped()) {
    if (std::isnan(c) || c == -std::numeric_limits<double>::infinity()) {
      throw std::invalid_argument("assign: costs must be numbers or +infinity");
    }
    if (std::isfinite(c)) {
      low = std::min(low, c);
      high = std::max(high, c);
    }
  }
  const double forbidden =
      (high - low + 1.0) * static_cast<double>(std::min(cost.rows(), cost.cols()) + 1) + high;
  return cost.unaryExpr([&](double c) { return std::isfinite(c) ? c : forbidden; });
}

}  // namespace

std::vector<int> assign(const Eigen::MatrixXd& cost) {
  std::vector<int> column_of(static_cast<std::size_t>(cost.rows()), -1);
  if (cost.rows() == 0 || cost.cols() == 0) return column_of;
  const Eigen::MatrixXd finite = priced(cost);
  if (cost.rows() <= cost.cols()) {
    column_of = solve(finite);
  } else {
    const std::vector<int> row_of = solve(finite.transpose());
    for (std::size_t j = 0; j < row_of.size(); ++j) column_of[row_of[j]] = static_cast<int>(j);
  }
  for (std::size_t i = 0; i < column_of.size(); ++i) {
    if (column_of[i] >= 0 && !std::isfinite(cost(static_cast<Eigen::Index>(i), column_of[i])))
      column_of[i] = -1;
  }
  return column_of;
}

}  // namespace omnifleet::evaluation
