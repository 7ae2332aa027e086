#include "occupancy/octree_file.h"

#include <octomap/OcTree.h>

#include <fstream>
#include <stdexcept>

namespace omnifleet::occupancy {

std::vector<Eigen::Vector3d> voxelsAboveFloor(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(path + ": cannot be opened");
  octomap::OcTree tree(0.1);
  if (!tree.readBinary(in)) throw std::runtime_error(path + ": is no OctoMap binary tree");
  tree.expand();
  std::vector<Eigen::Vector3d> middles;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (leaf.getZ() > tree.getResolution() && tree.isNodeOccupied(*leaf))
      middles.emplace_back(leaf.getX(), leaf.getY(), leaf.getZ());
  }
  return middles;
}

}  // namespace omnifleet::occupancy
