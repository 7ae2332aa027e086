#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "occupancy/occupancy_map.h"
#include "occupancy/ray_window.h"
#include "occupancy/sha256.h"

namespace omnifleet::occupancy {

/// L ← clamp(L + hits·l_hit + misses·l_miss), Hornung et al. 2013, eq. 2 and 4; log-odds in multiples of
/// 2⁻¹⁶.
struct CountFold {
  std::int32_t hit, miss, min, max;
  std::int32_t operator()(std::int32_t before, std::uint32_t hits, std::uint32_t misses) const {
    const std::int64_t sum = before + std::int64_t{hits} * hit + std::int64_t{misses} * miss;
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(sum, min, max));
  }
};

/// Counts of a square of cells, one layer per time bucket. All but the newest few layers are packed to a
/// sixth of their size. They are kept, because a late contribution or a corrected pose may change any of
/// them. Such a change unpacks the chunk.
class CellChunk {
 public:
  static constexpr std::size_t kCells = std::size_t{kChunk} * kChunk;
  static constexpr std::size_t kOpenLayers = 4;
  struct Count {
    std::uint32_t hits = 0, misses = 0;
    std::int32_t folded = 0;  ///< log-odds up to and including this bucket
  };
  using Counts = std::array<Count, kCells>;

  /// Index of the layer of the bucket, which is open. A new layer starts from the fold of the layer before.
  std::size_t layerFor(std::int64_t bucket, const CountFold& fold);
  bool isNewest(std::size_t layer) const { return layer + 1 == layers_.size(); }
  /// Counts of an open layer. Call touch() before writing them.
  Counts& counts(std::size_t layer) { return *layers_[layer].open; }
  /// Counts from which the fold of the layer starts.
  const Counts& before(std::size_t layer) const;
  /// The layer changes: the digests from it on become invalid.
  void touch(std::size_t layer) { digested_ = std::min(digested_, layer); }
  /// Adds to a cell's counts in an open layer and refolds from there on. Returns the log-odds after the last
  /// layer.
  std::int32_t add(std::size_t layer, std::size_t cell, int hits, int misses, const CountFold& fold);

  /// SHA-256 of (bucket, cell, hits, misses) of all non-zero counts, layer by layer, each chained with the
  /// digest of the layers before. All zeros if there are no counts.
  Sha256 digest();

  std::size_t packedLayers() const { return packed_; }

 private:
  struct Packed {
    std::array<std::uint8_t, kCells> hits, misses;
  };
  struct Layer {
    std::int64_t bucket = 0;
    std::unique_ptr<Counts> open;    ///< null if packed
    std::unique_ptr<Packed> packed;  ///< null if open
    Sha256 digest{};                 ///< chained with those of all layers before
  };
  void packOld();
  void unpack(const CountFold& fold);
  static Sha256 digestOf(const Layer& layer, const Sha256& before);

  std::vector<Layer> layers_;     ///< in order of bucket, packed ones first
  std::size_t packed_ = 0;        ///< number of packed layers
  std::unique_ptr<Counts> base_;  ///< folds at the end of the packed layers
  std::size_t digested_ = 0;      ///< number of layers with valid digests
};

}  // namespace omnifleet::occupancy
