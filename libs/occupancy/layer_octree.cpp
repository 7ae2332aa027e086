#include "occupancy/layer_octree.h"

#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
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
  setVoxel(x, y, 0, now);
}

LayerOctree LayerOctree::with(const std::vector<Column>& columns, const std::vector<VoxelKey>& voxels) const {
  LayerOctree copy(tree_->octree.getResolution());
  copy.tree_ = std::make_unique<Tree>(*tree_);
  for (const Column& column : columns)
    for (std::int64_t z = 0; z < column.levels; ++z)
      copy.setVoxel(column.x, column.y, z, CellClass::kOccupied);
  for (const VoxelKey& key : voxels) copy.setVoxel(key.x, key.y, key.z, CellClass::kOccupied);
  return copy;
}

void LayerOctree::setVoxel(std::int64_t x, std::int64_t y, std::int64_t z, CellClass now) {
  constexpr std::int64_t kCentre = 32768;
  if (x < -kCentre || x >= kCentre || y < -kCentre || y >= kCentre || z < 0 || z >= kCentre) return;
  auto& octree = tree_->octree;
  const octomap::OcTreeKey key(static_cast<octomap::key_type>(x + kCentre),
                               static_cast<octomap::key_type>(y + kCentre),
                               static_cast<octomap::key_type>(z + kCentre));
  const float value =
      now == CellClass::kOccupied ? octree.getClampingThresMaxLog() : octree.getClampingThresMinLog();
  octree.setNodeValue(key, value, true);  // lazy: inner nodes are neither used nor written
}

namespace {

/// Two bits per child, the lower one first: 00 unknown, 10 free, 01 occupied, 11 has children (OctoMap's
/// binary stream). Then the children that have children, in order. Written here because OctoMap's own writer
/// prints to stderr.
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

std::vector<LayerOctree::Column> columnsOf(const std::vector<dataset::MapObject>& objects,
                                           double resolution_m) {
  constexpr double kMostCells = 400.0;  // per side; wider outlines are not objects
  std::vector<LayerOctree::Column> columns;
  for (const dataset::MapObject& object : objects) {
    if (object.isOpen() || object.outline_m.size() < 3) continue;
    Eigen::Vector2d low = object.outline_m.front(), high = low;
    for (const Eigen::Vector2d& p : object.outline_m) low = low.cwiseMin(p), high = high.cwiseMax(p);
    if (!low.allFinite() || !high.allFinite() || (high - low).maxCoeff() > kMostCells * resolution_m)
      continue;
    const auto levels = std::max<std::int64_t>(1, std::llround(object.height_m / resolution_m));
    const auto cellOf = [&](double v) { return static_cast<std::int64_t>(std::floor(v / resolution_m)); };
    for (std::int64_t y = cellOf(low.y()); y <= cellOf(high.y()); ++y) {
      for (std::int64_t x = cellOf(low.x()); x <= cellOf(high.x()); ++x) {
        const Eigen::Vector2d middle_m =
            resolution_m * (Eigen::Vector2d(static_cast<double>(x), static_cast<double>(y)).array() + 0.5);
        if (contains(object.outline_m, middle_m)) columns.push_back({x, y, levels});
      }
    }
  }
  return columns;
}

}  // namespace omnifleet::occupancy
