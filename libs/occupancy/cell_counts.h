#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "occupancy/occupancy_map.h"
#include "occupancy/ray_window.h"
#include "occupancy/sha256.h"

namespace omnifleet::occupancy {

/// Hits and misses of every cell per time bucket, and their fold: L ← clamp(L + hits·l_hit + misses·l_miss)
/// from bucket to bucket (Hornung et al. 2013, eq. 2 and 4, log-odds as multiples of 2⁻¹⁶; a bucket is added
/// at once, so clamping acts between buckets). A cell is occupied where L ≥ 0, as in OctoMap.
class CellCounts {
 public:
  explicit CellCounts(const OccupancyOptions& options);

  /// Called for each cell whose class changed.
  using OnChange = std::function<void(std::int64_t x, std::int64_t y, CellClass now)>;

  /// Adds (`sign` +1) or takes out (−1) the marks of a window, those under `mask_bit` left out.
  void apply(const RayWindow& window, std::int64_t bucket, int sign, std::uint8_t mask_bit,
             const OnChange& changed);
  /// The same marks, but the cells under kMaskA are put back and those under kMaskB taken out.
  void exchangeMasks(const RayWindow& window, std::int64_t bucket, const OnChange& changed);

  CellClass at(std::int64_t x, std::int64_t y) const;
  void forEachKnown(const std::function<void(std::int64_t x, std::int64_t y, CellClass)>& visit) const;
  std::uint64_t known() const { return known_; }
  Sha256 hash() const;

 private:
  static constexpr int kCells = kChunk * kChunk;
  struct Count {
    std::uint32_t hits = 0, misses = 0;
    std::int32_t folded = 0;  ///< log-odds up to and including this bucket
  };
  struct Layer {
    std::int64_t bucket;
    std::array<Count, kCells> count;
  };
  struct Chunk {
    std::int64_t x = 0, y = 0;
    std::vector<std::unique_ptr<Layer>> layers;  ///< in order of bucket
    std::array<std::uint32_t, kCells> total{};
    std::array<CellClass, kCells> cell_class{};
    mutable Sha256 digest{};
    mutable bool is_digested = false;
  };

  static std::uint64_t keyOf(std::int64_t x, std::int64_t y);
  Chunk& chunkAt(std::int64_t x, std::int64_t y);
  std::size_t layerFor(Chunk& chunk, std::int64_t bucket);
  void change(Chunk& chunk, std::size_t layer, int cell, int hits, int misses, const OnChange& changed);
  void changeNewest(Chunk& chunk, Count* counts, const Count* before, int cell, int hits, int misses,
                    const OnChange& changed);
  void applyChunk(const RayWindow& window, int i, int j, std::int64_t bucket, int sign, std::uint8_t mask_bit,
                  const OnChange& changed);
  void setClass(Chunk& chunk, int cell, CellClass now, const OnChange& changed);
  /// The fold up to and including a bucket, from that of the one before.
  std::int32_t folding(std::int32_t before, const Count& count) const {
    const std::int64_t sum =
        before + std::int64_t{count.hits} * log_hit_ + std::int64_t{count.misses} * log_miss_;
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(sum, log_min_, log_max_));
  }
  std::vector<const Chunk*> inOrder() const;
  static Sha256 digestOf(const Chunk& chunk);

  std::int32_t log_hit_, log_miss_, log_min_, log_max_;
  std::int64_t resolution_dmm_, bucket_ns_;
  std::unordered_map<std::uint64_t, std::unique_ptr<Chunk>> chunks_;
  std::uint64_t known_ = 0;
};

}  // namespace omnifleet::occupancy
