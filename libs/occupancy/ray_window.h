#pragma once

#include <cstdint>
#include <vector>

#include "occupancy/body_mask.h"
#include "occupancy/contribution.h"
#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {

/// Effect of a ray on the cells. kNone: none. kFree: free up to and including its end. kHit: free up to its
/// end, which is hit. kOpen: free up to but excluding its end.
enum class RayRole : std::uint8_t { kNone, kFree, kHit, kOpen };

/// Cells are identified by integer coordinates; chunks are squares of kChunk cells.
inline constexpr int kChunk = 16;

/// Scratch grid around one scan. Each cell is marked once, however many rays cross it. Reused between scans.
class RayWindow {
 public:
  static constexpr std::uint8_t kMiss = 1, kHit = 2, kMaskA = 4, kMaskB = 8;

  RayWindow(std::int32_t resolution_dmm, std::int32_t max_range_dmm);

  /// Clears the window, centres it on the origin of the scan and draws its rays. `roles`: one per ray.
  void draw(const Contribution& contribution, const IntegerPose& at, const std::vector<RayRole>& roles);
  /// Sets `bit` in the cells whose centres lie under a body.
  void cover(const BodyMask& body, const IntegerPose& at, std::uint8_t bit);
  /// Whether the body can cover any cell of the window.
  bool isNear(const BodyMask& body, const IntegerPose& at, const Contribution& contribution,
              const IntegerPose& of) const;

  int chunksAcross() const { return chunks_; }
  /// Chunk coordinates of the window's lower left chunk.
  std::int64_t firstChunkX() const { return first_x_ / kChunk; }
  std::int64_t firstChunkY() const { return first_y_ / kChunk; }
  /// Row of kChunk marks: chunk (i, j) of the window, row `row` of it.
  const std::uint8_t* row(int chunk_x, int chunk_y, int row_in_chunk) const {
    return &marks_[static_cast<std::size_t>((chunk_y * kChunk + row_in_chunk) * width_ + chunk_x * kChunk)];
  }

 private:
  void drawRay(const PointDmm& from, const PointDmm& to, RayRole role);

  std::int64_t resolution_, max_range_;
  int chunks_, width_;
  std::int64_t first_x_ = 0, first_y_ = 0;  ///< lower left cell, multiples of kChunk
  std::vector<std::uint8_t> marks_;
};

/// Origin of the scan in map, 0.1 mm.
PointDmm scanOrigin(const Contribution& contribution, const IntegerPose& at);

}  // namespace omnifleet::occupancy
