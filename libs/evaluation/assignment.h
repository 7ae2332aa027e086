#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::evaluation {

/// Minimum-cost assignment of rows to columns (Hungarian method with potentials, Kuhn 1955 / Jonker–Volgenant
/// form, O(n²m)). Entries of +infinity forbid a pair. Returns the column of each row, −1 where a row stays
/// without; as many rows as possible are assigned, and among those assignments the cheapest is taken. Throws
/// std::invalid_argument for NaN or −infinity.
std::vector<int> assign(const Eigen::MatrixXd& cost);

}  // namespace omnifleet::evaluation
