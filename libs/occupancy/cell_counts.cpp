#include "occupancy/cell_counts.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "occupancy/log_odds.h"

namespace omnifleet::occupancy {
namespace {

bool isEmptyRow(const std::uint8_t* row) {
  std::uint64_t words[2];
  static_assert(sizeof(words) == kChunk);
  std::memcpy(words, row, sizeof(words));
  return (words[0] | words[1]) == 0;
}

}  // namespace

CellCounts::CellCounts(const OccupancyOptions& options)
    : fold_{logOdds(options.probability_hit), logOdds(options.probability_miss), logOdds(options.clamp_min),
            logOdds(options.clamp_max)},
      resolution_dmm_(std::llround(options.resolution_m * 1e4)),
      bucket_ns_(std::llround(options.bucket_s * 1e9)) {}

std::uint64_t CellCounts::keyOf(std::int64_t x, std::int64_t y) {
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32U) | static_cast<std::uint32_t>(y);
}

CellCounts::Chunk& CellCounts::chunkAt(std::int64_t x, std::int64_t y) {
  auto& chunk = chunks_[keyOf(x, y)];
  if (!chunk) {
    chunk = std::make_unique<Chunk>();
    chunk->x = x;
    chunk->y = y;
  }
  return *chunk;
}

void CellCounts::setClass(Chunk& chunk, std::size_t cell, CellClass now, const OnChange& changed) {
  CellClass& kept = chunk.cell_class[cell];
  if (kept == CellClass::kUnknown) ++known_;
  if (now == CellClass::kUnknown) --known_;
  kept = now;
  const auto c = static_cast<std::int64_t>(cell);
  changed(chunk.x * kChunk + c % kChunk, chunk.y * kChunk + c / kChunk, now);
}

/// Updates the class of a cell after marks were added to it.
inline void CellCounts::classify(Chunk& chunk, std::size_t cell, int marks, std::int32_t folded,
                                 const OnChange& changed) {
  const std::uint32_t total = chunk.total[cell] + static_cast<std::uint32_t>(marks);
  chunk.total[cell] = total;
  const CellClass now = total == 0    ? CellClass::kUnknown
                        : folded >= 0 ? CellClass::kOccupied
                                      : CellClass::kFree;
  if (now != chunk.cell_class[cell]) setClass(chunk, cell, now, changed);
}

/// Adds to a cell's counts in one bucket.
void CellCounts::change(Chunk& chunk, std::size_t layer, int cell, int hits, int misses,
                        const OnChange& changed) {
  const auto c = static_cast<std::size_t>(cell);
  classify(chunk, c, hits + misses, chunk.counts.add(layer, c, hits, misses, fold_), changed);
}

/// Adds to a cell's counts in the newest bucket, the usual case: no later bucket has to be refolded.
inline void CellCounts::changeNewest(Chunk& chunk, CellChunk::Counts& counts, const CellChunk::Counts& before,
                                     int cell, int hits, int misses, const OnChange& changed) {
  const auto c = static_cast<std::size_t>(cell);
  CellChunk::Count count = counts[c];
  count.hits += static_cast<std::uint32_t>(hits);
  count.misses += static_cast<std::uint32_t>(misses);
  count.folded = fold_(before[c].folded, count.hits, count.misses);
  counts[c] = count;
  classify(chunk, c, hits + misses, count.folded, changed);
}

void CellCounts::apply(const RayWindow& window, std::int64_t bucket, int sign, std::uint8_t mask_bit,
                       const OnChange& changed) {
  for (int j = 0; j < window.chunksAcross(); ++j)
    for (int i = 0; i < window.chunksAcross(); ++i) applyChunk(window, i, j, bucket, sign, mask_bit, changed);
}

void CellCounts::applyChunk(const RayWindow& window, int i, int j, std::int64_t bucket, int sign,
                            std::uint8_t mask_bit, const OnChange& changed) {
  Chunk* chunk = nullptr;
  std::size_t layer = 0;
  CellChunk::Counts* newest = nullptr;  // counts of the bucket if it is the newest
  const CellChunk::Counts* before = nullptr;
  for (int row = 0; row < kChunk; ++row) {
    const std::uint8_t* marks = window.row(i, j, row);
    if (isEmptyRow(marks)) continue;
    for (int column = 0; column < kChunk; ++column) {
      const std::uint8_t mark = marks[column];
      const bool driven = (mark & RayWindow::kDriven) != 0;
      const bool seen = (mark & (RayWindow::kMiss | RayWindow::kHit)) != 0 && (mark & mask_bit) == 0;
      if (!driven && !seen) continue;
      if (chunk == nullptr) {
        chunk = &chunkAt(window.firstChunkX() + i, window.firstChunkY() + j);
        layer = chunk->counts.layerFor(bucket, fold_);
        chunk->counts.touch(layer);
        before = &chunk->counts.before(layer);
        if (chunk->counts.isNewest(layer)) newest = &chunk->counts.counts(layer);
      }
      const bool hit = !driven && (mark & RayWindow::kHit) != 0;
      const int cell = row * kChunk + column, hits = hit ? sign : 0, misses = hit ? 0 : sign;
      if (newest != nullptr)
        changeNewest(*chunk, *newest, *before, cell, hits, misses, changed);
      else
        change(*chunk, layer, cell, hits, misses, changed);
    }
  }
}

void CellCounts::exchangeMasks(const RayWindow& window, std::int64_t bucket, const OnChange& changed) {
  constexpr std::uint8_t kBoth = RayWindow::kMaskA | RayWindow::kMaskB;
  for (int j = 0; j < window.chunksAcross(); ++j) {
    for (int i = 0; i < window.chunksAcross(); ++i) {
      for (int row = 0; row < kChunk; ++row) {
        const std::uint8_t* marks = window.row(i, j, row);
        if (isEmptyRow(marks)) continue;
        for (int column = 0; column < kChunk; ++column) {
          const std::uint8_t mark = marks[column], masks = mark & kBoth;
          if ((mark & (RayWindow::kMiss | RayWindow::kHit)) == 0 || masks == 0 || masks == kBoth) continue;
          if ((mark & RayWindow::kDriven) != 0) continue;
          Chunk& chunk = chunkAt(window.firstChunkX() + i, window.firstChunkY() + j);
          const int sign = masks == RayWindow::kMaskA ? 1 : -1;
          const bool hit = (mark & RayWindow::kHit) != 0;
          change(chunk, chunk.counts.layerFor(bucket, fold_), row * kChunk + column, hit ? sign : 0,
                 hit ? 0 : sign, changed);
        }
      }
    }
  }
}

CellClass CellCounts::at(std::int64_t x, std::int64_t y) const {
  const std::int64_t chunk_x = floorDivide(x, kChunk), chunk_y = floorDivide(y, kChunk);
  const auto found = chunks_.find(keyOf(chunk_x, chunk_y));
  if (found == chunks_.end()) return CellClass::kUnknown;
  return found->second
      ->cell_class[static_cast<std::size_t>((y - chunk_y * kChunk) * kChunk + x - chunk_x * kChunk)];
}

std::vector<CellCounts::Chunk*> CellCounts::inOrder() const {
  std::vector<Chunk*> all;
  all.reserve(chunks_.size());
  for (const auto& [key, chunk] : chunks_) all.push_back(chunk.get());
  std::sort(all.begin(), all.end(),
            [](const Chunk* a, const Chunk* b) { return a->y < b->y || (a->y == b->y && a->x < b->x); });
  return all;
}

void CellCounts::forEachKnown(const std::function<void(std::int64_t, std::int64_t, CellClass)>& visit) const {
  for (const Chunk* chunk : inOrder()) {
    for (int c = 0; c < kChunk * kChunk; ++c) {
      const CellClass now = chunk->cell_class[static_cast<std::size_t>(c)];
      if (now != CellClass::kUnknown)
        visit(chunk->x * kChunk + c % kChunk, chunk->y * kChunk + c / kChunk, now);
    }
  }
}

Sha256 CellCounts::hash() const {
  std::string bytes = "omnifleet-map-4";
  putBytes(bytes, resolution_dmm_);
  putBytes(bytes, bucket_ns_);
  for (const std::int32_t parameter : {fold_.hit, fold_.miss, fold_.min, fold_.max})
    putBytes(bytes, parameter);
  for (Chunk* chunk : inOrder()) {
    const Sha256 digest = chunk->counts.digest();
    if (digest == Sha256{}) continue;
    putBytes(bytes, chunk->x);
    putBytes(bytes, chunk->y);
    bytes.append(digest.begin(), digest.end());
  }
  return sha256(bytes);
}

}  // namespace omnifleet::occupancy
