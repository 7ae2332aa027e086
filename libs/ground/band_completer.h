#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Completes banded objects in which every other band looks like the floor, in full light or in shadow.
/// Example: posts painted red and white on a bright floor. The segmentation of such an object leaves bands as
/// thin as floor markings. Shadows and objects behind one another do not leave three or more pieces along one
/// line that are equally thin and equally spaced.
class BandCompleter {
 public:
  explicit BandCompleter(cv::Size image);

  /// True if the region is thin and short: it may be one band of an object.
  bool isBand(const Blob& region) const;
  /// True if the remaining pixels of a region form no compact object, but possibly bands.
  static bool isRagged(const Blob& region, const BitMask& left);

  struct Input {
    const BitMask& raw;            ///< pixels that differ from the floor, before despeckling
    const BitMask& cleaned;        ///< the same after despeckling, with pieces as thin as markings
    const cv::Mat1b& appearances;  ///< appearance class of each pixel
  };
  /// @param region part of it clearly differs from the floor
  /// @return runs, row by row, that cover the bands around the region and the gaps between them. Empty if
  /// there are no bands. Valid until the next call.
  const std::vector<Run>& find(const Blob& region, const Input& input);

 private:
  static constexpr int kMaxPieces = 12;
  /// Consecutive pieces along a line.
  struct Chain {
    int pieces = 0, begin_px = 0, end_px = 0;  ///< extent from the first gap to the last
    int least_gap_px = 0, most_gap_px = 0, gaps_px = 0;
    int bands_px = 0;                        ///< total length of the pieces that are no wider than bands
    int last_px = 0;                         ///< end of the last piece
    std::array<int, kMaxPieces - 1> gaps{};  ///< middle positions of the gaps
    void add(int piece_px, int gap_px);
    bool areBands() const;
  };
  struct Follower {
    Chain chain;
    int piece_px = 0;  ///< begin of the last piece
    bool in_piece = false;
  };
  /// Candidate bands along a row or a column.
  struct Line {
    int line;  ///< row or column index
    Chain chain;
    int before, after;  ///< number of matching lines up to this one and from this one on
  };
  bool findCore(const Input& input);
  void followRows();
  void followColumns();
  void follow(Follower& follower, int line, int at_px);
  void closeChain(Follower& follower, int line);
  void keepBands(bool columns);
  void setSearchArea(const cv::Rect& region, int beside_px);
  bool continuesBeyondSearch() const;
  static bool haveSameGaps(const Line& a, const Line& b);
  void countMatchingLines();
  void fillObjects();

  BitMask core_;          ///< within search_area_: neither shadow nor floor
  cv::Mat1b marks_;       ///< 1 on objects with bands; 0 between calls
  cv::Rect search_area_;  ///< the region with a margin
  std::vector<Follower> columns_;
  std::vector<Line> lines_;
  std::vector<cv::Rect> bands_;  ///< one pixel wide
  std::vector<Run> found_;
  int unit_px_;
};

}  // namespace omnifleet::ground
