#include "tracking/assignment.h"

#include <algorithm>
#include <limits>

namespace omnifleet::tracking {
namespace {

/// Square problem: the given costs, and one "unassigned" column per row at the price of the gate.
class Problem {
 public:
  Problem(const Eigen::MatrixXd& cost, double gate) : cost_(cost), gate_(gate) {}
  int rows() const { return static_cast<int>(cost_.rows()); }
  int columns() const { return static_cast<int>(cost_.cols() + cost_.rows()); }
  double operator()(int row, int column) const {
    if (column >= cost_.cols()) return gate_;
    return std::min(cost_(row, column), 1e6 * gate_ + 1e6);
  }

 private:
  const Eigen::MatrixXd& cost_;
  double gate_;
};

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// State of the shortest-augmenting-path form of the method; index 0 is a sentinel, rows and columns count
/// from 1.
struct Potentials {
  std::vector<double> row, column;
  std::vector<int> row_of;  ///< by column
  std::vector<int> way;
};

/// One step from the row of `column`: relaxes the free columns, returns the nearest of them.
int relax(const Problem& problem, int column, Potentials& p, std::vector<double>& nearest,
          std::vector<char>& used) {
  used[static_cast<std::size_t>(column)] = 1;
  const int row = p.row_of[static_cast<std::size_t>(column)];
  double delta = kInfinity;
  int next = 0;
  for (int j = 1; j <= problem.columns(); ++j) {
    const auto c = static_cast<std::size_t>(j);
    if (used[c]) continue;
    const double slack = problem(row - 1, j - 1) - p.row[static_cast<std::size_t>(row)] - p.column[c];
    if (slack < nearest[c]) {
      nearest[c] = slack;
      p.way[c] = column;
    }
    if (nearest[c] < delta) {
      delta = nearest[c];
      next = j;
    }
  }
  for (int j = 0; j <= problem.columns(); ++j) {
    const auto c = static_cast<std::size_t>(j);
    if (used[c]) {
      p.row[static_cast<std::size_t>(p.row_of[c])] += delta;
      p.column[c] -= delta;
    } else {
      nearest[c] -= delta;
    }
  }
  return next;
}

}  // namespace

std::vector<int> assign(const Eigen::MatrixXd& cost, double gate) {
  std::vector<int> result(static_cast<std::size_t>(cost.rows()), -1);
  if (cost.rows() == 0 || cost.cols() == 0) return result;
  const Problem problem(cost, gate);
  const auto columns = static_cast<std::size_t>(problem.columns());
  Potentials p{std::vector<double>(result.size() + 1, 0.0), std::vector<double>(columns + 1, 0.0),
               std::vector<int>(columns + 1, 0), std::vector<int>(columns + 1, 0)};
  for (int row = 1; row <= problem.rows(); ++row) {
    std::vector<double> nearest(columns + 1, kInfinity);
    std::vector<char> used(columns + 1, 0);
    p.row_of[0] = row;
    int column = 0;
    do {
      column = relax(problem, column, p, nearest, used);
    } while (p.row_of[static_cast<std::size_t>(column)] != 0);
    for (; column != 0; column = p.way[static_cast<std::size_t>(column)]) {
      p.row_of[static_cast<std::size_t>(column)] =
          p.row_of[static_cast<std::size_t>(p.way[static_cast<std::size_t>(column)])];
    }
  }
  for (int j = 1; j <= cost.cols(); ++j) {
    const int row = p.row_of[static_cast<std::size_t>(j)];
    if (row > 0 && cost(row - 1, j - 1) < gate) result[static_cast<std::size_t>(row - 1)] = j - 1;
  }
  return result;
}

}  // namespace omnifleet::tracking
