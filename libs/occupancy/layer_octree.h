#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "occupancy/occupancy_map.h"
#include "occupancy/voxel_counts.h"

namespace omnifleet::occupancy {

/// One layer of voxels (0 ≤ z < resolution), with columns on top, in an octomap::OcTree. OctoMap is included
/// only by the source of this class.
class LayerOctree {
 public:
  struct Column {
    std::int64_t x, y;
    std::int64_t levels;
  };

  explicit LayerOctree(double resolution_m);
  ~LayerOctree();
  LayerOctree(LayerOctree&&) noexcept;
  LayerOctree& operator=(LayerOctree&&) noexcept;

  /// `now`: free or occupied. Cells beyond OctoMap's 16-bit keys are ignored. Nothing is ever deleted:
  /// deleteNode of OctoMap 1.9.7 aborts if it empties a branch, so a cell that becomes unknown again needs a
  /// new tree.
  void set(std::int64_t x, std::int64_t y, CellClass now);
  /// A copy in which the voxels of level 0 to levels − 1 over these cells and the given voxels are occupied.
  LayerOctree with(const std::vector<Column>& columns, const std::vector<VoxelKey>& voxels) const;
  /// Content of the .bt file. Leaves hold one of two values, so equal cells give equal bytes.
  std::string bytes() const;

 private:
  class Tree;
  void setVoxel(std::int64_t x, std::int64_t y, std::int64_t z, CellClass now);
  std::unique_ptr<Tree> tree_;
};

/// Columns over the cells whose centres lie in the objects' footprints, as high as the objects (at least one
/// level; one level if the height is unknown). Ordered by object, row and column.
std::vector<LayerOctree::Column> columnsOf(const std::vector<dataset::MapObject>& objects,
                                           double resolution_m);

}  // namespace omnifleet::occupancy
