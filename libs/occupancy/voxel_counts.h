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

/// Integer coordinates of a voxel, ordered by x, y, z; z = 0 is the layer that scans draw.
struct VoxelKey {
  std::int32_t x, y, z;
  friend bool operator<(const VoxelKey& a, const VoxelKey& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  }
  friend bool operator==(const VoxelKey& a, const VoxelKey& b) {
    return std::tie(a.x, a.y, a.z) == std::tie(b.x, b.y, b.z);
  }
};

/// How a contribution is applied to the map.
struct Applied {
  std::shared_ptr<const Contribution> contribution;
  IntegerPose at;
  std::vector<RayRole> roles;  ///< of its rays
  RayCuts cuts;
  std::vector<VoxelKey> voxels;  ///< that contain its points, sorted, without duplicates
  std::vector<std::pair<std::string, IntegerPose>> robots;  ///< those that cover cells, sorted by name
  /// Footprint of the robot that took the scan: the cells under it are free. Null: its body is unknown.
  const BodyMask* body = nullptr;
  std::int64_t body_margin_dmm = 0;  ///< negative: by what the footprint shrinks for the σ of the pose, and
                                     ///< so that it covers whole cells
};
using AppliedSet = std::map<std::pair<std::string, TimeNs>, Applied>;

/// Voxels above the floor layer that contain surface points of objects. A contribution counts once per voxel.
/// It is a hit if one of its points lies there; else a miss if the floor is seen at the place that the voxel
/// would hide. Hits and misses are folded like those of the cells (CellCounts), so the points of a box that
/// was moved away vanish. The counts are a function of the set of applied contributions. A voxel is kept
/// while any of them has a point in it, and it has the misses of all of them, whenever it was created. The
/// cost of a contribution is that of the voxels within its range and, for each new voxel, of the
/// contributions within range.
class VoxelCounts {
 public:
  explicit VoxelCounts(const OccupancyOptions& options);

  /// Adds a contribution. It must keep its address and stay unchanged until it is removed.
  void add(const Applied& what);
  void remove(const Applied& what);
  /// Occupied voxels, sorted.
  std::vector<VoxelKey> occupied() const;
  bool empty() const { return voxels_.empty(); }
  /// All counts as bytes, sorted.
  std::string canonicalBytes() const;

  /// Voxel of a point above the floor layer and within range. Returns false for other points.
  bool keyOf(const SurfacePoint& point, const Contribution& contribution, const IntegerPose& at,
             VoxelKey& key) const;

 private:
  struct Count {
    std::int64_t bucket;
    std::int32_t hits, misses;
  };
  using Counts = std::vector<Count>;  ///< sorted by bucket, none empty
  /// Viewpoint of a contribution.
  struct Viewpoint {
    PointDmm foot;  ///< map
    std::int64_t height_dmm;
    Direction heading;
  };
  struct Observer {
    const Applied* what;
    Viewpoint viewpoint;
  };
  using Tile = std::pair<std::int64_t, std::int64_t>;  ///< squares whose side is the range of the rays

  static void change(Counts& counts, std::int64_t bucket, int hits, int misses);
  void create(const VoxelKey& key);
  void count(const Observer& observer, int sign);
  static Viewpoint viewpointOf(const Applied& what);
  Tile tileOf(std::int64_t x_dmm, std::int64_t y_dmm) const {
    return {floorDivide(x_dmm, max_range_dmm_), floorDivide(y_dmm, max_range_dmm_)};
  }
  bool seesThrough(const Observer& observer, const VoxelKey& key) const;
  std::int64_t bucketOf(const Applied& what) const {
    return floorDivide(what.contribution->acquired_ns, bucket_ns_);
  }

  std::int64_t resolution_dmm_, max_range_dmm_, bucket_ns_;
  std::int32_t log_hit_, log_miss_, log_min_, log_max_;
  std::int32_t least_hits_;
  std::map<VoxelKey, Counts> voxels_;
  std::map<Tile, std::vector<Observer>> observers_;  ///< by position
  mutable Bearings bearings_;                        ///< of a scan with as many rays as the last one
};

}  // namespace omnifleet::occupancy
