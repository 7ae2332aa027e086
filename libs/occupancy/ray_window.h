#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "occupancy/body_mask.h"
#include "occupancy/contribution.h"
#include "occupancy/fixed_trig.h"
#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {

/// Effect of a ray on the cells. kNone: none. kFree: free up to and including its end. kHit: free up to
/// `free_sigmas` σ before its end, which is hit. kOpen: free up to but excluding the cell there. kHitOnly:
/// its end is hit, the cells before are not free. kHitBeyond: likewise, and floor was seen right before its
/// end.
enum class RayRole : std::uint8_t { kNone, kFree, kHit, kOpen, kHitOnly, kHitBeyond };

/// Lengths in 0.1 mm.
struct RayLimits {
  std::int64_t resolution, max_range;
  std::int64_t hit_permille = 750;    ///< σ of a hit, at most, in thousandths of a cell
  std::int64_t free_permille = 3000;  ///< floor is shown up to this many thousandths of σ before the end
};
RayLimits rayLimitsOf(const OccupancyOptions& options);

/// How far a ray is drawn, in 0.1 mm: free up to `free` before the end at `range`.
struct RayExtent {
  std::int64_t range, free;
  RayRole role;
  bool at_floor = false;  ///< of a hit: floor was seen right before it, though not all the way
};
/// Per ray, the range at which it enters the footprint of another robot, in 0.1 mm; 0: it crosses none.
/// Empty: none does. Nothing is known of what lies beyond.
using RayCuts = std::vector<std::int32_t>;
/// Range of ray i, at most that of its cut.
inline std::int64_t rangeOf(const Contribution& contribution, std::size_t i, const RayCuts& cuts) {
  const std::int32_t range = contribution.range_dmm[i];
  return i < cuts.size() && cuts[i] > 0 ? std::min(range, cuts[i]) : range;
}
/// Ray i of a contribution. Beyond the maximum range it is cut there, and it ends at nothing. A hit whose σ
/// exceeds half a cell cannot be assigned to a cell: the ray shows only floor before it. A ray that crosses
/// the footprint of another robot ends there at nothing.
RayExtent extentOf(const Contribution& contribution, std::size_t i, RayRole role, const RayLimits& limits,
                   const RayCuts& cuts = {});

/// Cells are identified by integer coordinates; chunks are squares of kChunk cells.
inline constexpr int kChunk = 16;

/// Scratch grid around one scan. Each cell is marked once, however many rays cross it. Reused between scans.
class RayWindow {
 public:
  static constexpr std::uint8_t kMiss = 1, kHit = 2, kMaskA = 4, kMaskB = 8;
  /// Under the robot that took the scan: free, whatever rays and masks say.
  static constexpr std::uint8_t kDriven = 16;

  explicit RayWindow(const RayLimits& limits);

  /// Clears the window, centres it on the origin of the scan and draws its rays. `roles`: one per ray.
  void draw(const Contribution& contribution, const IntegerPose& at, const std::vector<RayRole>& roles,
            const RayCuts& cuts = {});
  /// Sets `bit` in the cells whose centres lie under a body. `more`: added to its margin, 0.1 mm.
  void cover(const BodyMask& body, const IntegerPose& at, std::int64_t more_dmm, std::uint8_t bit);
  /// Whether the body can cover any cell of the window.
  bool isNear(const BodyMask& body, const IntegerPose& at, std::int64_t more_dmm,
              const Contribution& contribution, const IntegerPose& of) const;

  int chunksAcross() const { return chunks_; }
  /// Chunk coordinates of the window's lower left chunk.
  std::int64_t firstChunkX() const { return first_x_ / kChunk; }
  std::int64_t firstChunkY() const { return first_y_ / kChunk; }
  /// Row of kChunk marks: chunk (i, j) of the window, row `row` of it.
  const std::uint8_t* row(int chunk_x, int chunk_y, int row_in_chunk) const {
    return &marks_[static_cast<std::size_t>((chunk_y * kChunk + row_in_chunk) * width_ + chunk_x * kChunk)];
  }

 private:
  /// Marks the cells from one point up to but excluding that of the other, and that one with `at_end`.
  void drawRay(const PointDmm& from, const PointDmm& to, std::uint8_t at_end);
  void mark(const PointDmm& at, std::uint8_t bit);

  RayLimits limits_;
  int chunks_, width_;
  std::int64_t first_x_ = 0, first_y_ = 0;  ///< lower left cell, multiples of kChunk
  std::vector<std::uint8_t> marks_;
};

/// Origin of the scan in map, 0.1 mm.
PointDmm scanOrigin(const Contribution& contribution, const IntegerPose& at);

}  // namespace omnifleet::occupancy
