#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::tracking {

/// Minimum-cost assignment of rows to columns (Kuhn–Munkres with potentials, O(n³)). A pair that costs `gate`
/// or more stays unassigned, at a price of `gate` per row. Returns the column of each row, or −1. Costs must
/// not be NaN. Infinity forbids a pair.
std::vector<int> assign(const Eigen::MatrixXd& cost, double gate);

}  // namespace omnifleet::tracking
