#include "occupancy/octree_file.h"

#include <octomap/OcTree.h>

#include <fstream>
#include <iostream>
#include <stdexcept>

namespace omnifleet::occupancy {

namespace {

/// OctoMap reports on its reading to the standard streams; nobody asked.
class Quiet {
 public:
  Quiet() : out_(std::cout.rdbuf(nullptr)), err_(std::cerr.rdbuf(nullptr)) {}
  ~Quiet() {
    std::cout.rdbuf(out_);
    std::cerr.rdbuf(err_);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  std::streambuf *out_, *err_;
};

bool readQuietly(octomap::OcTree& tree, std::istream& in) {
  const Quiet quiet;
  return tree.readBinary(in);
}

}  // namespace

std::vector<Eigen::Vector3d> voxelsAboveFloor(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(path + ": cannot be opened");
  octomap::OcTree tree(0.1);
  if (!readQuietly(tree, in)) throw std::runtime_error(path + ": is no OctoMap binary tree");
  tree.expand();
  std::vector<Eigen::Vector3d> middles;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (leaf.getZ() > tree.getResolution() && tree.isNodeOccupied(*leaf))
      middles.emplace_back(leaf.getX(), leaf.getY(), leaf.getZ());
  }
  return middles;
}

}  // namespace omnifleet::occupancy
