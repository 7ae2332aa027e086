#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace omnifleet::occupancy {

/// Middles of the occupied voxels of a .bt file that lie above its floor layer (0 ≤ z < resolution), metres,
/// at its finest resolution. Throws std::runtime_error naming the file where it cannot be read.
std::vector<Eigen::Vector3d> voxelsAboveFloor(const std::string& path);

}  // namespace omnifleet::occupancy
