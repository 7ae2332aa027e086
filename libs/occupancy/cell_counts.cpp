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
    : log_hit_(logOdds(options.probability_hit)),
      log_miss_(logOdds(options.probability_miss)),
      log_min_(logOdds(options.clamp_min)),
      log_max_(logOdds(options.clamp_max)),
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

/// Index of the bucket's layer; a new one takes over the fold of the one before it.
std::size_t CellCounts::layerFor(Chunk& chunk, std::int64_t bucket) {
  auto& layers = chunk.layers;
  std::size_t i = layers.size();
  while (i > 0 && layers[i - 1]->bucket > bucket) --i;
  if (i > 0 && layers[i - 1]->bucket == bucket) return i - 1;
  auto layer = std::make_unique<Layer>();
  layer->bucket = bucket;
  if (i > 0) {
    for (std::size_t c = 0; c < kCells; ++c) layer->count[c].folded = layers[i - 1]->count[c].folded;
  }
  layers.insert(layers.begin() + static_cast<std::ptrdiff_t>(i), std::move(layer));
  return i;
}

/// Adds to a cell's counts in one bucket, and folds anew from there on.
void CellCounts::change(Chunk& chunk, std::size_t layer, int cell, int hits, int misses,
                        const OnChange& changed) {
  const auto c = static_cast<std::size_t>(cell);
  auto& layers = chunk.layers;
  Count& count = layers[layer]->count[c];
  count.hits += static_cast<std::uint32_t>(hits);  // unsigned: adding −1 takes one away
  count.misses += static_cast<std::uint32_t>(misses);
  chunk.total[c] += static_cast<std::uint32_t>(hits + misses);
  std::int32_t folded = folding(layer > 0 ? layers[layer - 1]->count[c].folded : 0, count);
  count.folded = folded;
  for (std::size_t i = layer + 1; i < layers.size(); ++i) {
    Count& later = layers[i]->count[c];
    folded = folding(folded, later);
    if (later.folded == folded) break;  // those behind it stay as they are
    later.folded = folded;
  }
  const bool is_known = chunk.total[c] > 0;
  const CellClass now = !is_known                             ? CellClass::kUnknown
                        : layers.back()->count[c].folded >= 0 ? CellClass::kOccupied
                                                              : CellClass::kFree;
  if (now != chunk.cell_class[c]) setClass(chunk, cell, now, changed);
}

void CellCounts::setClass(Chunk& chunk, int cell, CellClass now, const OnChange& changed) {
  CellClass& kept = chunk.cell_class[static_cast<std::size_t>(cell)];
  if (kept == CellClass::kUnknown) ++known_;
  if (now == CellClass::kUnknown) --known_;
  kept = now;
  changed(chunk.x * kChunk + cell % kChunk, chunk.y * kChunk + cell / kChunk, now);
}

/// Adds to a cell's counts in the newest bucket, the usual case: nothing behind it is folded anew.
inline void CellCounts::changeNewest(Chunk& chunk, Count* counts, const Count* before, int cell, int hits,
                                     int misses, const OnChange& changed) {
  const auto c = static_cast<std::size_t>(cell);
  Count count = counts[c];
  count.hits += static_cast<std::uint32_t>(hits);
  count.misses += static_cast<std::uint32_t>(misses);
  count.folded = folding(before[c].folded, count);
  counts[c] = count;
  const std::uint32_t total = chunk.total[c] + static_cast<std::uint32_t>(hits + misses);
  chunk.total[c] = total;
  const CellClass now = total == 0          ? CellClass::kUnknown
                        : count.folded >= 0 ? CellClass::kOccupied
                                            : CellClass::kFree;
  if (now != chunk.cell_class[c]) setClass(chunk, cell, now, changed);
}

void CellCounts::apply(const RayWindow& window, std::int64_t bucket, int sign, std::uint8_t mask_bit,
                       const OnChange& changed) {
  for (int j = 0; j < window.chunksAcross(); ++j)
    for (int i = 0; i < window.chunksAcross(); ++i) applyChunk(window, i, j, bucket, sign, mask_bit, changed);
}

void CellCounts::applyChunk(const RayWindow& window, int i, int j, std::int64_t bucket, int sign,
                            std::uint8_t mask_bit, const OnChange& changed) {
  static const Layer kNothing{};
  Chunk* chunk = nullptr;
  std::size_t layer = 0;
  Count* newest = nullptr;  // counts of the bucket, where it is the newest
  const Count* before = kNothing.count.data();
  for (int row = 0; row < kChunk; ++row) {
    const std::uint8_t* marks = window.row(i, j, row);
    if (isEmptyRow(marks)) continue;
    for (int column = 0; column < kChunk; ++column) {
      const std::uint8_t mark = marks[column];
      if ((mark & (RayWindow::kMiss | RayWindow::kHit)) == 0 || (mark & mask_bit) != 0) continue;
      if (chunk == nullptr) {
        chunk = &chunkAt(window.firstChunkX() + i, window.firstChunkY() + j);
        layer = layerFor(*chunk, bucket);
        chunk->is_digested = false;
        if (layer + 1 == chunk->layers.size()) newest = chunk->layers[layer]->count.data();
        if (layer > 0) before = chunk->layers[layer - 1]->count.data();
      }
      const bool hit = (mark & RayWindow::kHit) != 0;
      const int cell = row * kChunk + column, hits = hit ? sign : 0, misses = hit ? 0 : sign;
      if (newest != nullptr)
        changeNewest(*chunk, newest, before, cell, hits, misses, changed);
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
          Chunk& chunk = chunkAt(window.firstChunkX() + i, window.firstChunkY() + j);
          chunk.is_digested = false;
          const int sign = masks == RayWindow::kMaskA ? 1 : -1;
          const bool hit = (mark & RayWindow::kHit) != 0;
          change(chunk, layerFor(chunk, bucket), row * kChunk + column, hit ? sign : 0, hit ? 0 : sign,
                 changed);
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

std::vector<const CellCounts::Chunk*> CellCounts::inOrder() const {
  std::vector<const Chunk*> all;
  all.reserve(chunks_.size());
  for (const auto& [key, chunk] : chunks_) all.push_back(chunk.get());
  std::sort(all.begin(), all.end(),
            [](const Chunk* a, const Chunk* b) { return a->y < b->y || (a->y == b->y && a->x < b->x); });
  return all;
}

void CellCounts::forEachKnown(const std::function<void(std::int64_t, std::int64_t, CellClass)>& visit) const {
  for (const Chunk* chunk : inOrder()) {
    for (int c = 0; c < kCells; ++c) {
      const CellClass now = chunk->cell_class[static_cast<std::size_t>(c)];
      if (now != CellClass::kUnknown)
        visit(chunk->x * kChunk + c % kChunk, chunk->y * kChunk + c / kChunk, now);
    }
  }
}

/// SHA-256 of (bucket, cell, hits, misses) of all counts that are not zero; all zeros where there are none.
Sha256 CellCounts::digestOf(const Chunk& chunk) {
  std::string bytes;
  for (const auto& layer : chunk.layers) {
    for (std::size_t c = 0; c < kCells; ++c) {
      const Count& count = layer->count[c];
      if (count.hits == 0 && count.misses == 0) continue;
      putBytes(bytes, layer->bucket);
      putBytes(bytes, static_cast<std::uint16_t>(c));
      putBytes(bytes, count.hits);
      putBytes(bytes, count.misses);
    }
  }
  return bytes.empty() ? Sha256{} : sha256(bytes);
}

Sha256 CellCounts::hash() const {
  std::string bytes = "omnifleet-map-1";
  putBytes(bytes, resolution_dmm_);
  putBytes(bytes, bucket_ns_);
  for (const std::int32_t parameter : {log_hit_, log_miss_, log_min_, log_max_}) putBytes(bytes, parameter);
  for (const Chunk* chunk : inOrder()) {
    if (!chunk->is_digested) {
      chunk->digest = digestOf(*chunk);
      chunk->is_digested = true;
    }
    if (chunk->digest == Sha256{}) continue;
    putBytes(bytes, chunk->x);
    putBytes(bytes, chunk->y);
    bytes.append(chunk->digest.begin(), chunk->digest.end());
  }
  return sha256(bytes);
}

}  // namespace omnifleet::occupancy
