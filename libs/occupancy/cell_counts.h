#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <unordered_map>
#include <vector>

#include "occupancy/cell_chunk.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/ray_window.h"
#include "occupancy/sha256.h"

namespace omnifleet::occupancy {

/// Hits and misses of every cell per time bucket, and their fold (CountFold) from bucket to bucket. The
/// counts of a bucket are folded together, so clamping acts between buckets. A cell is occupied if L ≥ 0, as
/// in OctoMap.
class CellCounts {
 public:
  explicit CellCounts(const OccupancyOptions& options);

  /// Called for each cell whose class changed.
  using OnChange = std::function<void(std::int64_t x, std::int64_t y, CellClass now)>;

  /// Adds (`sign` +1) or removes (−1) the marks of a window, except those under `mask_bit`. A cell under the
  /// robot itself (kDriven) counts as a miss in any case.
  void apply(const RayWindow& window, std::int64_t bucket, int sign, std::uint8_t mask_bit,
             const OnChange& changed);
  /// For the same marks: adds those under kMaskA again and removes those under kMaskB.
  void exchangeMasks(const RayWindow& window, std::int64_t bucket, const OnChange& changed);

  CellClass at(std::int64_t x, std::int64_t y) const;
  void forEachKnown(const std::function<void(std::int64_t x, std::int64_t y, CellClass)>& visit) const;
  std::uint64_t known() const { return known_; }
  Sha256 hash() const;

 private:
  struct Chunk {
    std::int64_t x = 0, y = 0;
    CellChunk counts;
    std::array<std::uint32_t, CellChunk::kCells> total{};
    std::array<CellClass, CellChunk::kCells> cell_class{};
  };

  static std::uint64_t keyOf(std::int64_t x, std::int64_t y);
  Chunk& chunkAt(std::int64_t x, std::int64_t y);
  void change(Chunk& chunk, std::size_t layer, int cell, int hits, int misses, const OnChange& changed);
  void changeNewest(Chunk& chunk, CellChunk::Counts& counts, const CellChunk::Counts& before, int cell,
                    int hits, int misses, const OnChange& changed);
  void applyChunk(const RayWindow& window, int i, int j, std::int64_t bucket, int sign, std::uint8_t mask_bit,
                  const OnChange& changed);
  void classify(Chunk& chunk, std::size_t cell, int marks, std::int32_t folded, const OnChange& changed);
  void setClass(Chunk& chunk, std::size_t cell, CellClass now, const OnChange& changed);
  std::vector<Chunk*> inOrder() const;

  CountFold fold_;
  std::int64_t resolution_dmm_, bucket_ns_;
  std::unordered_map<std::uint64_t, std::unique_ptr<Chunk>> chunks_;
  std::uint64_t known_ = 0;
};

}  // namespace omnifleet::occupancy
