#include "occupancy/octree_file.h"

#include <octomap/OcTree.h>

#include <fstream>
#include <iostream>
#include <stdexcept>

namespace omnifleet::occupancy {

namespace {

/// Suppresses the messages that OctoMap's reader prints to the standard streams.
class SilencedStreams {
 public:
  SilencedStreams() : out_(std::cout.rdbuf(nullptr)), err_(std::cerr.rdbuf(nullptr)) {}
  ~SilencedStreams() {
    std::cout.rdbuf(out_);
    std::cerr.rdbuf(err_);
  }
  SilencedStreams(const SilencedStreams&) = delete;
  SilencedStreams& operator=(const SilencedStreams&) = delete;

 private:
  std::streambuf *out_, *err_;
};

bool readQuietly(octomap::OcTree& tree, std::istream& in) {
  const SilencedStreams quiet;
  return tree.readBinary(in);
}

}  // namespace

std::vector<Eigen::Vector3d> voxelsAboveFloor(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(path + ": cannot be opened");
  octomap::OcTree tree(0.1);
  if (!readQuietly(tree, in)) throw std::runtime_error(path + ": not an OctoMap binary tree");
  tree.expand();
  std::vector<Eigen::Vector3d> middles;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (leaf.getZ() > tree.getResolution() && tree.isNodeOccupied(*leaf))
      middles.emplace_back(leaf.getX(), leaf.getY(), leaf.getZ());
  }
  return middles;
}

}  // namespace omnifleet::occupancy
