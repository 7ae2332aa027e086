#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::evaluation {

/// Minimum-cost assignment of rows to columns (Hungarian method with potentials, Kuhn 1955, in the form of
/// Jonker and Volgenant, O(n²m)). Entries of +infinity forbid a pair. As many rows as possible are assigned;
/// among those assignments the one with the least cost is returned: the column of each row, −1 if the row is
/// not assigned. Throws std::invalid_argument for NaN or −infinity.
std::vector<int> assign(const Eigen::MatrixXd& cost);

}  // namespace omnifleet::evaluation
