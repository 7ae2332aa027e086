#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::tracking {

/// Least-cost assignment of rows to columns (Kuhn–Munkres with potentials, O(n³)); pairs dearer than `gate`
/// are left out, at the price of `gate` each. Column of every row, or −1. Costs must not be NaN; infinity
/// forbids a pair.
std::vector<int> assign(const Eigen::MatrixXd& cost, double gate);

}  // namespace omnifleet::tracking
