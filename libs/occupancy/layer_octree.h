#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "occupancy/occupancy_map.h"
#include "occupancy/voxel_counts.h"

namespace omnifleet::occupancy {

/// One layer of voxels (0 ≤ z < resolution), and columns upon it, in an octomap::OcTree, which only this
/// class's source includes.
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

  /// `now` free or occupied. Cells beyond OctoMap's 16-bit keys are left out. Nothing is ever deleted:
  /// OctoMap 1.9.7's deleteNode aborts where it empties a branch, so a cell that becomes unknown again needs
  /// a new tree.
  void set(std::int64_t x, std::int64_t y, CellClass now);
  /// A copy with the voxels of level 0 to levels − 1 over these cells and the voxels occupied.
  LayerOctree with(const std::vector<Column>& columns, const std::vector<VoxelKey>& voxels) const;
  /// The .bt file. Leaves hold one of two values, so equal cells give equal bytes.
  std::string bytes() const;

 private:
  class Tree;
  void setVoxel(std::int64_t x, std::int64_t y, std::int64_t z, CellClass now);
  std::unique_ptr<Tree> tree_;
};

/// Over the cells whose middles lie in the objects' footprints, as high as the objects (at least one level;
/// objects of unknown height one). In order of objects, rows and columns.
std::vector<LayerOctree::Column> columnsOf(const std::vector<dataset::MapObject>& objects,
                                           double resolution_m);

}  // namespace omnifleet::occupancy
