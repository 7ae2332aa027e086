#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "occupancy/bearings.h"
#include "occupancy/body_mask.h"
#include "occupancy/contribution.h"
#include "occupancy/fixed_trig.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/ray_window.h"

namespace omnifleet::occupancy {

/// Integer coordinates of a voxel, by order of x, y, z; z = 0 is the layer that scans draw.
struct VoxelKey {
  std::int32_t x, y, z;
  friend bool operator<(const VoxelKey& a, const VoxelKey& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  }
  friend bool operator==(const VoxelKey& a, const VoxelKey& b) {
    return std::tie(a.x, a.y, a.z) == std::tie(b.x, b.y, b.z);
  }
};

/// How a contribution stands in the map.
struct Applied {
  std::shared_ptr<const Contribution> contribution;
  Standing at;
  std::vector<RayRole> roles;                            ///< of its rays
  std::vector<VoxelKey> voxels;                          ///< that hold its points, in order, each once
  std::vector<std::pair<std::string, Standing>> robots;  ///< those that cover cells, in order of name
};
using AppliedSet = std::map<std::pair<std::string, TimeNs>, Applied>;

/// Voxels above the floor's layer that hold points of things. A contribution counts once per voxel: a hit
/// where one of its points lies, else a miss where it sees through: where the floor is seen at the place that
/// the voxel would hide. Hits and misses are folded as the cells' are (CellCounts), so a moved box's points
/// vanish. A function of the set of contributions that are applied: a voxel is kept while any of them has a
/// point in it, and has the misses of all of them, whenever it came to be known. A contribution costs what it
/// can see: the voxels within its range, and for each that is new the contributions that stand within range.
class VoxelCounts {
 public:
  explicit VoxelCounts(const OccupancyOptions& options);

  /// Adds a contribution; it stays where it is and as it is until it is removed.
  void add(const Applied& what);
  void remove(const Applied& what);
  /// Voxels that are occupied, in order.
  std::vector<VoxelKey> occupied() const;
  bool empty() const { return voxels_.empty(); }
  /// Everything that is counted, in order, as bytes.
  std::string canonicalBytes() const;

  /// The voxel of a point above the floor's layer and within reach; false for others.
  bool keyOf(const SurfacePoint& point, const Contribution& contribution, const Standing& at,
             VoxelKey& key) const;

 private:
  struct Count {
    std::int64_t bucket;
    std::int32_t hits, misses;
  };
  using Counts = std::vector<Count>;  ///< in order of bucket, none empty
  /// Where a contribution looks from.
  struct Eye {
    PointDmm foot;  ///< map
    std::int64_t height_dmm;
    Direction heading;
  };
  struct Looker {
    const Applied* what;
    Eye eye;
  };
  using Tile = std::pair<std::int64_t, std::int64_t>;  ///< squares as wide as rays reach

  static void change(Counts& counts, std::int64_t bucket, int hits, int misses);
  void create(const VoxelKey& key);
  void count(const Looker& looker, int sign);
  static Eye eyeOf(const Applied& what);
  Tile tileOf(std::int64_t x_dmm, std::int64_t y_dmm) const {
    return {floorDivide(x_dmm, max_range_dmm_), floorDivide(y_dmm, max_range_dmm_)};
  }
  bool seesThrough(const Looker& looker, const VoxelKey& key) const;
  std::int64_t bucketOf(const Applied& what) const {
    return floorDivide(what.contribution->acquired_ns, bucket_ns_);
  }

  std::int64_t resolution_dmm_, max_range_dmm_, bucket_ns_;
  std::int32_t log_hit_, log_miss_, log_min_, log_max_;
  std::int32_t least_hits_;
  std::map<VoxelKey, Counts> voxels_;
  std::map<Tile, std::vector<Looker>> lookers_;  ///< by where they stand
  mutable Bearings bearings_;                    ///< of a scan with as many rays as the last one
};

}  // namespace omnifleet::occupancy
