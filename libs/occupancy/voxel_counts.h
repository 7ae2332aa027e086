#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

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
/// point in it, and has the misses of all of them, whenever it came to be known.
class VoxelCounts {
 public:
  explicit VoxelCounts(const OccupancyOptions& options);

  /// Adds (`sign` +1) or takes out (−1) one contribution; `all` are those applied besides, and `but` is not
  /// counted among them.
  void apply(const Applied& what, int sign, const AppliedSet& all, const Applied* but);
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
  struct Eye;

  static void change(Counts& counts, std::int64_t bucket, int hits, int misses);
  void create(const VoxelKey& key, const AppliedSet& all, const Applied* but);
  Eye eyeOf(const Applied& what) const;
  bool seesThrough(const Eye& eye, const Applied& what, const VoxelKey& key) const;
  std::size_t rayBefore(const PointDmm& to, std::size_t rays) const;
  std::int64_t bucketOf(const Applied& what) const {
    return floorDivide(what.contribution->acquired_ns, bucket_ns_);
  }

  std::int64_t resolution_dmm_, max_range_dmm_, bucket_ns_;
  std::int32_t log_hit_, log_miss_, log_min_, log_max_;
  std::int32_t least_hits_;
  std::map<VoxelKey, Counts> voxels_;
  mutable std::vector<Direction> bearings_;  ///< of a scan with as many rays as the last one
};

}  // namespace omnifleet::occupancy
