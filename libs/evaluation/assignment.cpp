#include "evaluation/assignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace omnifleet::evaluation {
namespace {

/// Shortest augmenting paths on the reduced costs. Requires rows ≤ columns and finite costs. Rows and columns
/// count from 1; column 0 stands for the row that is being added.
class Solver {
 public:
  explicit Solver(const Eigen::MatrixXd& cost)
      : cost_(cost), u_(cost.rows() + 1, 0.0), v_(cost.cols() + 1, 0.0), row_of_(cost.cols() + 1, 0) {}

  std::vector<int> solve() {
    for (int row = 1; row <= cost_.rows(); ++row) add(row);
    std::vector<int> column_of(static_cast<std::size_t>(cost_.rows()), -1);
    for (std::size_t j = 1; j < row_of_.size(); ++j) {
      if (row_of_[j] > 0) column_of[row_of_[j] - 1] = static_cast<int>(j) - 1;
    }
    return column_of;
  }

 private:
  void add(int row) {
    row_of_[0] = row;
    slack_.assign(row_of_.size(), std::numeric_limits<double>::infinity());
    previous_.assign(row_of_.size(), 0);
    used_.assign(row_of_.size(), false);
    std::size_t column = 0;
    do {
      used_[column] = true;
      column = nearestFrom(column);
    } while (row_of_[column] != 0);
    for (; column != 0; column = previous_[column]) row_of_[column] = row_of_[previous_[column]];
  }

  /// Relaxes the edges of the row assigned to `column`, updates the potentials, and returns the next column
  /// of the tree.
  std::size_t nearestFrom(std::size_t column) {
    const int row = row_of_[column];
    std::size_t best = 0;
    double delta = std::numeric_limits<double>::infinity();
    for (std::size_t j = 1; j < row_of_.size(); ++j) {
      if (used_[j]) continue;
      const double reduced = cost_(row - 1, static_cast<Eigen::Index>(j) - 1) - u_[row] - v_[j];
      if (reduced < slack_[j]) {
        slack_[j] = reduced;
        previous_[j] = column;
      }
      if (slack_[j] < delta) {
        delta = slack_[j];
        best = j;
      }
    }
    for (std::size_t j = 0; j < row_of_.size(); ++j) {
      if (used_[j]) {
        u_[row_of_[j]] += delta;
        v_[j] -= delta;
      } else {
        slack_[j] -= delta;
      }
    }
    return best;
  }

  const Eigen::MatrixXd& cost_;
  std::vector<double> u_, v_;  ///< dual potentials of rows and columns
  std::vector<int> row_of_;    ///< row of each column, 0: free
  std::vector<double> slack_;
  std::vector<std::size_t> previous_;
  std::vector<bool> used_;
};

/// Gives forbidden pairs a cost above any sum of allowed ones, so that they are used only if no allowed pair
/// is left.
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
    column_of = Solver(finite).solve();
  } else {
    const Eigen::MatrixXd transposed = finite.transpose();
    const std::vector<int> row_of = Solver(transposed).solve();
    for (std::size_t j = 0; j < row_of.size(); ++j) column_of[row_of[j]] = static_cast<int>(j);
  }
  for (std::size_t i = 0; i < column_of.size(); ++i) {
    if (column_of[i] >= 0 && !std::isfinite(cost(static_cast<Eigen::Index>(i), column_of[i])))
      column_of[i] = -1;
  }
  return column_of;
}

}  // namespace omnifleet::evaluation
