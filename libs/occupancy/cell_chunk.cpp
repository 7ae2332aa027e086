#include "occupancy/cell_chunk.h"

#include <limits>
#include <string>
#include <utility>

#include "occupancy/log_odds.h"

namespace omnifleet::occupancy {

const CellChunk::Counts& CellChunk::before(std::size_t layer) const {
  static const Counts kNothing{};
  if (layer > packed_) return *layers_[layer - 1].open;
  return packed_ > 0 ? *base_ : kNothing;
}

std::size_t CellChunk::layerFor(std::int64_t bucket, const CountFold& fold) {
  std::size_t i = layers_.size();
  while (i > 0 && layers_[i - 1].bucket > bucket) --i;
  const bool is_there = i > 0 && layers_[i - 1].bucket == bucket;
  if (i < packed_ || (is_there && i <= packed_)) unpack(fold);
  if (is_there) return i - 1;
  Layer layer;
  layer.bucket = bucket;
  layer.open = std::make_unique<Counts>();
  const Counts& earlier = before(i);
  for (std::size_t c = 0; c < kCells; ++c) (*layer.open)[c].folded = earlier[c].folded;
  touch(i);
  layers_.insert(layers_.begin() + static_cast<std::ptrdiff_t>(i), std::move(layer));
  if (isNewest(i)) packOld();
  return i;
}

std::int32_t CellChunk::add(std::size_t layer, std::size_t cell, int hits, int misses,
                            const CountFold& fold) {
  touch(layer);
  Count& count = counts(layer)[cell];
  count.hits += static_cast<std::uint32_t>(hits);  // unsigned: adding −1 subtracts one
  count.misses += static_cast<std::uint32_t>(misses);
  std::int32_t folded = fold(before(layer)[cell].folded, count.hits, count.misses);
  count.folded = folded;
  for (std::size_t i = layer + 1; i < layers_.size(); ++i) {
    Count& later = counts(i)[cell];
    folded = fold(folded, later.hits, later.misses);
    if (later.folded == folded) break;  // the layers after it do not change
    later.folded = folded;
  }
  return counts(layers_.size() - 1)[cell].folded;
}

/// A layer with a count beyond eight bits stays open, and so do the layers after it.
void CellChunk::packOld() {
  constexpr std::uint32_t kMost = std::numeric_limits<std::uint8_t>::max();
  while (layers_.size() - packed_ > kOpenLayers) {
    Layer& layer = layers_[packed_];
    auto packed = std::make_unique<Packed>();
    for (std::size_t c = 0; c < kCells; ++c) {
      const Count& count = (*layer.open)[c];
      if (count.hits > kMost || count.misses > kMost) return;
      packed->hits[c] = static_cast<std::uint8_t>(count.hits);
      packed->misses[c] = static_cast<std::uint8_t>(count.misses);
    }
    layer.packed = std::move(packed);
    base_ = std::move(layer.open);
    ++packed_;
  }
}

void CellChunk::unpack(const CountFold& fold) {
  std::array<std::int32_t, kCells> folded{};
  for (std::size_t i = 0; i < packed_; ++i) {
    Layer& layer = layers_[i];
    layer.open = std::make_unique<Counts>();
    for (std::size_t c = 0; c < kCells; ++c) {
      folded[c] = fold(folded[c], layer.packed->hits[c], layer.packed->misses[c]);
      (*layer.open)[c] = {layer.packed->hits[c], layer.packed->misses[c], folded[c]};
    }
    layer.packed.reset();
  }
  packed_ = 0;
  base_.reset();
}

Sha256 CellChunk::digestOf(const Layer& layer, const Sha256& before) {
  std::string bytes;
  for (std::size_t c = 0; c < kCells; ++c) {
    const std::uint32_t hits = layer.open ? (*layer.open)[c].hits : layer.packed->hits[c];
    const std::uint32_t misses = layer.open ? (*layer.open)[c].misses : layer.packed->misses[c];
    if (hits == 0 && misses == 0) continue;
    putBytes(bytes, layer.bucket);
    putBytes(bytes, static_cast<std::uint16_t>(c));
    putBytes(bytes, hits);
    putBytes(bytes, misses);
  }
  if (bytes.empty()) return before;
  bytes.append(before.begin(), before.end());
  return sha256(bytes);
}

Sha256 CellChunk::digest() {
  for (; digested_ < layers_.size(); ++digested_) {
    const Sha256 before = digested_ > 0 ? layers_[digested_ - 1].digest : Sha256{};
    layers_[digested_].digest = digestOf(layers_[digested_], before);
  }
  return layers_.empty() ? Sha256{} : layers_.back().digest;
}

}  // namespace omnifleet::occupancy
