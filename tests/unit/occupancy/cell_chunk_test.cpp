#include "occupancy/cell_chunk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <utility>
#include <vector>

namespace omnifleet::occupancy {
namespace {

constexpr CountFold kFold{55000, -26000, -130000, 230000};

struct Mark {
  std::int64_t bucket;
  std::size_t cell;
  int hits, misses;
};

/// Reference: all marks of a bucket summed, then folded in order of bucket. The chunk must give the same,
/// whatever it packs.
std::int32_t folded(const std::vector<Mark>& marks, std::size_t cell) {
  std::map<std::int64_t, std::pair<int, int>> sums;
  for (const Mark& m : marks) {
    if (m.cell != cell) continue;
    sums[m.bucket].first += m.hits;
    sums[m.bucket].second += m.misses;
  }
  double l = 0;
  for (const auto& [bucket, sum] : sums)
    l = std::clamp(l + double(sum.first) * kFold.hit + double(sum.second) * kFold.miss, double(kFold.min),
                   double(kFold.max));
  return static_cast<std::int32_t>(l);
}

std::int32_t add(CellChunk& chunk, const Mark& mark) {
  return chunk.add(chunk.layerFor(mark.bucket, kFold), mark.cell, mark.hits, mark.misses, kFold);
}

/// Marks in order of time, as a run of many buckets gives them.
std::vector<Mark> marksOf(int buckets, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Mark> marks;
  for (int b = 0; b < buckets; ++b) {
    for (int i = 0; i < 30; ++i) {
      const bool hit = random() % 3 == 0;
      marks.push_back({b, random() % 12, hit ? 1 : 0, hit ? 0 : 1});
    }
  }
  return marks;
}

TEST(CellChunk, KeepsLogOddsWhenPackingOldLayers) {
  const auto marks = marksOf(40, 1);
  CellChunk chunk;
  std::vector<Mark> so_far;
  for (const Mark& mark : marks) {
    so_far.push_back(mark);
    ASSERT_EQ(add(chunk, mark), folded(so_far, mark.cell));
  }
  EXPECT_EQ(chunk.packedLayers(), 40 - CellChunk::kOpenLayers);
}

TEST(CellChunk, IsIndependentOfOrderAndUnpacksForLateMarks) {
  auto marks = marksOf(40, 2);
  CellChunk in_order, shuffled;
  for (const Mark& mark : marks) add(in_order, mark);
  const Sha256 digest = in_order.digest();
  EXPECT_NE(digest, Sha256{});
  // A late mark: everything after it is refolded, also after the mark is removed again.
  std::vector<Mark> with = marks;
  with.push_back({3, 5, 2, 0});
  EXPECT_EQ(add(in_order, with.back()), folded(with, 5));
  EXPECT_NE(in_order.digest(), digest);
  add(in_order, {3, 5, -2, 0});
  EXPECT_EQ(in_order.digest(), digest);
  std::shuffle(marks.begin(), marks.end(), std::mt19937(3));
  std::map<std::size_t, std::int32_t> last;
  for (const Mark& mark : marks) last[mark.cell] = add(shuffled, mark);
  for (const auto& [cell, l] : last) EXPECT_EQ(l, folded(marks, cell)) << cell;
  EXPECT_EQ(shuffled.digest(), digest);
}

TEST(CellChunk, InsertsLateBucketBetweenPackedOnes) {
  CellChunk chunk;
  std::vector<Mark> marks;
  for (int b = 0; b < 20; ++b) marks.push_back({2 * b, 0, b % 3 == 0, b % 3 != 0});
  for (const Mark& mark : marks) add(chunk, mark);
  ASSERT_GT(chunk.packedLayers(), 0U);
  for (const std::int64_t bucket : {-1, 7, 31, 33}) {
    marks.push_back({bucket, 0, 1, 0});
    EXPECT_EQ(add(chunk, marks.back()), folded(marks, 0)) << bucket;
  }
}

TEST(CellChunk, StaysExactBeyondEightBitCounts) {
  CellChunk chunk;
  std::vector<Mark> marks;
  for (int b = 0; b < 12; ++b)
    for (int i = 0; i < 300; ++i) marks.push_back({b, 1, b % 2, 1 - b % 2});
  std::int32_t l = 0;
  for (const Mark& mark : marks) l = add(chunk, mark);
  EXPECT_EQ(chunk.packedLayers(), 0U);
  EXPECT_EQ(l, folded(marks, 1));
}

TEST(CellChunk, HasZeroDigestAfterRemovingAllMarks) {
  CellChunk chunk;
  for (int b = 0; b < 10; ++b) add(chunk, {b, 2, 1, 0});
  for (int b = 0; b < 10; ++b) add(chunk, {b, 2, -1, 0});
  EXPECT_EQ(chunk.digest(), Sha256{});
}

}  // namespace
}  // namespace omnifleet::occupancy
