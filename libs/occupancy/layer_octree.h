#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {

/// One layer of voxels (0 ≤ z < resolution) in an octomap::OcTree, which only this class's source includes.
class LayerOctree {
 public:
  explicit LayerOctree(double resolution_m);
  ~LayerOctree();
  LayerOctree(LayerOctree&&) noexcept;
  LayerOctree& operator=(LayerOctree&&) noexcept;

  /// `now` free or occupied. Cells beyond OctoMap's 16-bit keys are left out. Nothing is ever deleted:
  /// OctoMap 1.9.7's deleteNode aborts where it empties a branch, so a cell that becomes unknown again needs
  /// a new tree.
  void set(std::int64_t x, std::int64_t y, CellClass now);
  /// The .bt file. Leaves hold one of two values, so equal cells give equal bytes.
  std::string bytes() const;

 private:
  class Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace omnifleet::occupancy
