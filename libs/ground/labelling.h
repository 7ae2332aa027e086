#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/strip.h"

namespace omnifleet::ground {

/// Columns [begin, end) of one row that belong to one region.
struct Run {
  int row, begin, end;
};

/// A labelled region (Choi §III.2): its enclosing rectangle, size and runs in the order of rows. After the
/// region connection it may consist of several pieces.
struct Blob {
  int label = 0;  ///< 1…N
  cv::Rect rect;
  int area_px = 0;
  std::vector<Run> runs;
};

/// Connected components (8 neighbours) by runs and union-find; only the strips are scanned. Labels by first
/// pixel in reading order.
class Labeller {
 public:
  /// @return the regions with at least min_area_px pixels; valid until the next call
  const std::vector<Blob>& label(const cv::Mat1b& objects, const std::vector<Strip>& strips, int min_area_px);

 private:
  void findRuns(const cv::Mat1b& objects, const std::vector<Strip>& strips);
  void joinRows();
  int root(int run);
  void unite(int a, int b);
  void collect(int min_area_px);

  std::vector<Run> runs_;
  std::vector<int> row_begin_, parent_, blob_of_root_;
  std::vector<Blob> blobs_;
  std::vector<Blob> spare_;
};

}  // namespace omnifleet::ground
