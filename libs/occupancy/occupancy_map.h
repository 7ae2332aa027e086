#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dataset/map_files.h"
#include "observation/observation.h"
#include "occupancy/contribution_store.h"
#include "options/options.h"
#include "structure/mirrors.h"
#include "structure/surface_map.h"

namespace omnifleet::occupancy {

struct OccupancyOptions {
  double resolution_m = 0.05;    ///< m, side of a cell (a multiple of 0.1 mm)
  double max_range_m = 3.0;      ///< m, rays are cut there; hits beyond are ignored
  double bucket_s = 5.0;         ///< s of data time per bucket of counts
  double probability_hit = 0.7;  ///< OctoMap's sensor model
  double probability_miss = 0.4;
  double clamp_min = 0.1192;  ///< OctoMap's clamping thresholds, probabilities
  double clamp_max = 0.971;
  double robot_margin_m = 0.01;  ///< m, by which the given footprint of a robot may be wrong, …
  double robot_sigmas = 3.0;     ///< 1, … plus so many σ of its pose, …
  /// m, … at most: the place of a robot whose pose is worse says nothing.
  double most_robot_margin_m = 0.15;
  /// m, side of the square around other robots, parallel to the axes of map, in which nothing is mapped
  /// (Ahmed et al. 2013 §2.2; rays are not cut there); 0: their footprints.
  double robot_window_m = 0.0;
  bool driven_is_free = true;  ///< whether the floor under a robot that maps is free
  double hold_s = 1.0;     ///< s, a robot is assumed at its nearest pose for this long before and after it
  double max_gap_s = 5.0;  ///< s, poses farther apart are not interpolated
  double default_radius_m = 0.15;  ///< m, of robots without a given body
  bool unknown_is_hit = false;     ///< whether rays at objects of undecided kind mark a cell as hit
  double hit_cells = 0.75;         ///< cells: a ray whose σ is larger shows floor, but its end is not a hit
  /// m, likewise: in a dim room, hits up to 3.75 cm (0.75 cells of 5 cm) put 13 % of the cells more than 2 cm
  /// off, hits up to 2.5 cm 8 %.
  double most_hit_sigma_m = 0.025;
  double free_sigmas = 3.0;  ///< σ before the end of a ray up to which it shows floor
  /// Of the weight of the ray ends in a cell and in the next one along the rays; a cell with less holds the
  /// noise of the other. 0.2: the surface lies about one σ beyond the border between the two.
  double least_share = 0.2;
  double least_gap_m = 0.15;  ///< m, gaps between occupied cells of at most this hide the floor behind
  structure::MirrorOptions mirrors;
  int least_point_hits = 2;  ///< contributions that must have seen a point in a voxel before it counts

  static OccupancyOptions read(const options::Section& section);
};

enum class CellClass : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

/// One layer of cells as a function of a set of contributions, a set of keyframe poses and the kinds of
/// tracks decided at the end. The result does not depend on order, duplicates, restarts or the machine. Rays
/// are traversed in integers (Amanatides & Woo 1987). Every contribution counts once per cell, and a hit
/// outweighs misses. Counts in time buckets are folded in order of time with OctoMap's clamped log-odds
/// (Hornung et al. 2013, eq. 2–4), so a box that was moved away vanishes. The OctoMap octree is written only
/// where a cell changes class. After a change of a pose or of the error of a robot's camera, the affected
/// contributions are removed exactly and added again. Robots are not mapped. Rays at a robot (by label, by
/// sighting, or by the kind of its track, whenever known) and cells under a robot's footprint at that time
/// (poses interpolated between keyframes) are left out. They are removed if that becomes known later.
///
/// A map has a frame: the common one, or a robot's own one. The sets hold all samples; the map is made of the
/// poses in its frame. Not thread-safe.
class OccupancyMap {
 public:
  /// @param frame as in KeyframePose::frame
  OccupancyMap(const OccupancyOptions& options, const std::map<std::string, RobotBody>& bodies,
               std::string frame = {});
  ~OccupancyMap();
  OccupancyMap(OccupancyMap&&) noexcept;
  OccupancyMap& operator=(OccupancyMap&&) noexcept;

  /// Lenses of the robots' cameras; call before anything is added. Equidistant for robots that are not
  /// listed.
  void setLenses(std::map<std::string, lens::Spread> lenses);
  /// Returns true if the set changed. A contribution enters the cells once its pose in the map is known.
  bool add(const Contribution& contribution);
  bool add(const KeyframePose& pose);
  /// From this call on, contributions that have to be recomputed after a new estimate of a camera error are
  /// recomputed by correctSome(). Before, the pose that reports the error recomputes them all. In a map that
  /// has grown for a long time they are many.
  void correctLater();
  /// Recomputes at most that many of them. Returns false if there are none.
  bool correctSome(std::size_t at_most);
  /// Overrides the kinds of (robot, track) that the contributions report. Kind unknown: a floor marking,
  /// which is no obstacle. Also recomputes all contributions that correctLater() deferred.
  void overrideKinds(const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds);

  const ContributionStore& store() const;
  /// Class by the counts alone.
  CellClass at(const Eigen::Vector2d& point_m) const;
  /// The cells without those that contradict each other (visible_map.h). Computed when the map has changed.
  const structure::SurfaceMap& visible() const;
  /// Grid of the visible cells (−1 unknown, 0 free, 100 occupied); width 0 if no cell is known. Cells
  /// whose centre lies in an object's footprint are occupied regardless of rays: an object of about the
  /// floor's colour is missed in many frames, where the rays see floor in its place.
  dataset::OccupancyGrid grid(const std::vector<dataset::MapObject>& objects = {}) const;
  /// OctoMap's binary format (.bt): one layer of voxels at 0 ≤ z < resolution. Over every cell whose centre
  /// lies in an object's footprint there are voxels up to the object's height. Above the layer there are also
  /// the voxels that contain surface points of objects (voxel_counts.h). Equal maps and objects give equal
  /// bytes. Objects of unknown height (≤ 0) occupy the layer only.
  std::string octreeBytes(const std::vector<dataset::MapObject>& objects = {}) const;
  /// SHA-256 over the parameters and, for every chunk in order of its key, the SHA-256 of its (cell, bucket,
  /// hits, misses) in order. If there are voxels with points, the SHA-256 over that hash and their counts.
  /// Only chunks that changed are hashed again.
  std::array<std::uint8_t, 32> hash() const;
  /// Number of class changes of cells by their counts since construction.
  std::uint64_t classChanges() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Lower-case hexadecimal.
std::string hexText(const std::array<std::uint8_t, 32>& bytes);

}  // namespace omnifleet::occupancy
