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

namespace omnifleet::occupancy {

struct OccupancyOptions {
  double resolution_m = 0.05;    ///< m, side of a cell (a multiple of 0.1 mm)
  double max_range_m = 3.0;      ///< m, rays are cut there; hits beyond are left out
  double bucket_s = 5.0;         ///< s, counts are kept per such span of data time
  double probability_hit = 0.7;  ///< OctoMap's sensor model
  double probability_miss = 0.4;
  double clamp_min = 0.1192;  ///< OctoMap's clamping thresholds, probabilities
  double clamp_max = 0.971;
  double robot_margin_m = 0.05;  ///< m, kept free of marks around a robot's footprint
  double hold_s = 1.0;  ///< s, a robot counts as standing at its nearest pose this long before and after it
  double max_gap_s = 5.0;          ///< s, poses farther apart are not interpolated
  double default_radius_m = 0.15;  ///< m, of robots whose body is not given
  bool unknown_is_hit = false;     ///< do rays at things not yet told from robots mark a cell?
  int least_point_hits = 2;        ///< contributions that saw a point in a voxel before it counts

  static OccupancyOptions read(const options::Section& section);
};

enum class CellClass : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

/// One layer of cells as a function of a set of contributions, a set of keyframe poses and a judgement (kinds
/// of tracks decided at the end): order, duplicates, restarts and the machine do not matter. Rays are
/// traversed in integers (Amanatides & Woo 1987); every contribution counts once per cell, a hit outweighs
/// misses. Counts in time buckets are folded in order of time through OctoMap's clamped log-odds (Hornung et
/// al. 2013, eq. 2–4), so a moved box vanishes; the OctoMap octree is written only where a cell changes
/// class. A changed pose, or another error of the robot's camera, takes contributions out exactly and puts
/// them back. Robots never enter: rays at a robot (by label, by sighting, or by what its track is known to be
/// at any time) and cells under a robot's footprint at that time (poses interpolated between keyframes) are
/// left out, and taken out when that is learned later. Not for threads.
class OccupancyMap {
 public:
  OccupancyMap(const OccupancyOptions& options, const std::map<std::string, RobotBody>& bodies);
  ~OccupancyMap();
  OccupancyMap(OccupancyMap&&) noexcept;
  OccupancyMap& operator=(OccupancyMap&&) noexcept;

  /// Of the robots' cameras, before anything is added; equidistant where nothing is said.
  void setLenses(std::map<std::string, lens::Spread> lenses);
  /// True when the set changed. A contribution enters the cells once its valid pose is there.
  bool add(const Contribution& contribution);
  bool add(const KeyframePose& pose);
  /// Contributions that have to be put anew because more is known of a robot's camera are put with the pose
  /// that tells it, or, from this call on, when correctSome() asks: of a map that has grown for long they are
  /// many.
  void correctLater();
  /// At most so many of them; false where there are none.
  bool correctSome(std::size_t at_most);
  /// Kinds of (robot, track) beyond what the contributions themselves say; unknown: a mark on the floor,
  /// which stands in nobody's way. Leaves nothing to be put anew.
  void judge(const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds);

  const ContributionStore& store() const;
  CellClass at(const Eigen::Vector2d& point_m) const;
  /// Bounding grid of all known cells (−1 unknown, 0 free, 100 occupied); width 0 when nothing is known.
  /// Cells whose middle lies in an object's footprint are occupied, whatever rays say: a thing of about the
  /// floor's colour is lost in many frames, and where it stands they see floor.
  dataset::OccupancyGrid grid(const std::vector<dataset::MapObject>& objects = {}) const;
  /// OctoMap's binary format (.bt): one layer of voxels at 0 ≤ z < resolution, and over every cell whose
  /// middle lies in an object's footprint voxels up to its height; above the layer also the voxels that hold
  /// points of things (voxel_counts.h). Equal maps and objects give equal bytes. Objects of unknown height
  /// (≤ 0) stand in the layer alone.
  std::string octreeBytes(const std::vector<dataset::MapObject>& objects = {}) const;
  /// SHA-256 over the parameters and, for every chunk in order of its key, the SHA-256 of its (cell, bucket,
  /// hits, misses) in order; where there are voxels with points, over that and theirs. Only chunks that
  /// changed are hashed anew.
  std::array<std::uint8_t, 32> hash() const;
  /// Cells whose class changed since construction: work done on the octree.
  std::uint64_t classChanges() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Lower-case hexadecimal.
std::string hexText(const std::array<std::uint8_t, 32>& bytes);

}  // namespace omnifleet::occupancy
