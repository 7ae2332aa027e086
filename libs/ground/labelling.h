#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"

namespace omnifleet::ground {

/// Columns [begin, end) of one row that belong to one region.
struct Run {
  int row, begin, end;
};

/// A labelled region (Choi §III.2): bounding rectangle, area and runs sorted by row. After region connection
/// it may consist of several pieces.
struct Blob {
  int label = 0;  ///< 1…N
  cv::Rect rect;
  int area_px = 0;
  std::vector<Run> runs;
};

inline cv::Point middleOf(const Blob& blob) {
  return blob.rect.tl() + cv::Point(blob.rect.width / 2, blob.rect.height / 2);
}

/// Converts a region of blocks of block_px × block_px to pixels. The label of `pixels` stays unchanged.
void enlarge(const Blob& blocks, int block_px, Blob& pixels);

/// Pool of regions whose buffers are reused. Each buffer is reserved for the largest region so far. It
/// therefore does not matter which buffer serves which region, and nothing is allocated once the fullest
/// frame has been processed.
class BlobPool {
 public:
  /// @return a region without runs
  Blob take();
  void give(Blob&& blob);
  /// Returns all regions to the pool; `blobs` is empty afterwards.
  void give(std::vector<Blob>& blobs);

 private:
  std::vector<Blob> spare_;
  std::size_t most_runs_ = 64;
};

/// Connected components (8-neighbourhood) by runs and union-find. Only the area is scanned. Labels are
/// numbered by the first pixel in reading order.
class Labeller {
 public:
  /// @return the regions with at least min_area_px pixels; valid until the next call
  const std::vector<Blob>& label(const BitMask& objects, const BitArea& area, int min_area_px);

 private:
  void findRuns(const BitMask& objects, const BitArea& area);
  void findRunsOf(const BitMask::Word* words, int row, const BitArea::Span& span);
  void joinRows();
  int root(int run);
  void unite(int a, int b);
  void collect(int min_area_px);

  std::vector<Run> runs_;
  std::vector<int> row_begin_, parent_, blob_of_root_;
  std::vector<Blob> blobs_;
  BlobPool pool_;
};

}  // namespace omnifleet::ground
