#include "occupancy/layer_octree.h"

#include <octomap/OcTree.h>

#include <cstdint>
#include <sstream>
#include <string>

namespace omnifleet::occupancy {

class LayerOctree::Tree {
 public:
  explicit Tree(double resolution_m) : octree(resolution_m) {}
  octomap::OcTree octree;
};

LayerOctree::LayerOctree(double resolution_m) : tree_(std::make_unique<Tree>(resolution_m)) {}
LayerOctree::~LayerOctree() = default;
LayerOctree::LayerOctree(LayerOctree&&) noexcept = default;
LayerOctree& LayerOctree::operator=(LayerOctree&&) noexcept = default;

void LayerOctree::set(std::int64_t x, std::int64_t y, CellClass now) {
  constexpr std::int64_t kCentre = 32768;
  if (x < -kCentre || x >= kCentre || y < -kCentre || y >= kCentre) return;
  auto& octree = tree_->octree;
  const octomap::OcTreeKey key(static_cast<octomap::key_type>(x + kCentre),
                               static_cast<octomap::key_type>(y + kCentre),
                               static_cast<octomap::key_type>(kCentre));
  const float value =
      now == CellClass::kOccupied ? octree.getClampingThresMaxLog() : octree.getClampingThresMinLog();
  octree.setNodeValue(key, value, true);  // inner nodes are not asked and not written
}

namespace {

/// Two bits per child: 00 unknown, 10 free, 01 occupied, 11 has children (OctoMap's binary stream); then the
/// children that have children, in order. Written here because OctoMap's own writer chatters on stderr.
void putNode(const octomap::OcTree& tree, const octomap::OcTreeNode* node, std::string& bytes) {
  std::uint32_t bits = 0;
  for (unsigned i = 0; i < 8; ++i) {
    if (!tree.nodeChildExists(node, i)) continue;
    const auto* child = tree.getNodeChild(node, i);
    const std::uint32_t code = tree.nodeHasChildren(child) ? 3U : tree.isNodeOccupied(child) ? 2U : 1U;
    bits |= code << (2 * i);
  }
  bytes.push_back(static_cast<char>(bits & 0xFFU));
  bytes.push_back(static_cast<char>(bits >> 8U));
  for (unsigned i = 0; i < 8; ++i) {
    if ((bits >> (2 * i) & 3U) == 3U) putNode(tree, tree.getNodeChild(node, i), bytes);
  }
}

}  // namespace

std::string LayerOctree::bytes() const {
  const auto& octree = tree_->octree;
  std::ostringstream header;
  header << "# Octomap OcTree binary file\n"
         << "# (feel free to add / change comments, but leave the first line as it is!)\n#\n"
         << "id " << octree.getTreeType() << "\nsize " << octree.size() << "\nres " << octree.getResolution()
         << "\ndata\n";
  std::string bytes = header.str();
  if (octree.getRoot() != nullptr) putNode(octree, octree.getRoot(), bytes);
  return bytes;
}

}  // namespace omnifleet::occupancy
