#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace omnifleet::occupancy {

/// Centres of the occupied voxels of a .bt file above its floor layer (0 ≤ z < resolution), metres, at its
/// finest resolution. Throws std::runtime_error with the file name if the file cannot be read.
std::vector<Eigen::Vector3d> voxelsAboveFloor(const std::string& path);

}  // namespace omnifleet::occupancy
