#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Completes things in bands, of which every other one is like the floor, in full light or in shade: posts
/// painted red and white on a bright floor. What is left of such a thing are bands as thin as markings of
/// the floor. Neither shadows nor things one behind the other leave three and more pieces along one line
/// that are all as thin and as far apart.
class BandCompleter {
 public:
  explicit BandCompleter(cv::Size image);

  /// It may be a band of a thing, alone: thin and short.
  bool isBand(const Blob& region) const;
  /// What is left of a region is no compact thing: bands, maybe.
  static bool isRagged(const Blob& region, const BitMask& left);

  struct Seen {
    const BitMask& raw;      ///< what differs from the floor, not yet despeckled
    const BitMask& cleaned;  ///< the same despeckled, with what is as thin as markings
    const cv::Mat1b& looks;  ///< of the pixels
  };
  /// @param region of which some is plainly no floor
  /// @return the bands around the region with what lies between them, by rows, valid until the next call;
  /// empty where there are none
  const std::vector<Run>& find(const Blob& region, const Seen& seen);

 private:
  static constexpr int kMostPieces = 12;
  /// Pieces along a line as they follow one another.
  struct Chain {
    int pieces = 0, begin_px = 0, end_px = 0;  ///< from the first gap to the last
    int least_gap_px = 0, most_gap_px = 0, gaps_px = 0;
    int bands_px = 0;                         ///< the pieces' that are no wider than bands
    int last_px = 0;                          ///< where the last piece ends
    std::array<int, kMostPieces - 1> gaps{};  ///< their middles
    void add(int piece_px, int gap_px);
    bool areBands() const;
  };
  struct Follower {
    Chain chain;
    int piece_px = 0;  ///< where the last piece began
    bool is_piece = false;
  };
  /// What looks like bands, along a row or a column.
  struct Line {
    int line;  ///< which row or column
    Chain chain;
    int before, after;  ///< lines up to this and from this on that show the same
  };
  bool findCore(const Seen& seen);
  void followRows();
  void followColumns();
  void follow(Follower& along, int line, int at_px);
  void take(Follower& along, int line);
  void keepBands(bool columns);
  void lookAround(const cv::Rect& region, int beside_px);
  bool goesOn() const;
  static bool showTheSame(const Line& a, const Line& b);
  void countBeside();
  void fillThings();

  BitMask core_;     ///< within around_: no shade and no floor
  cv::Mat1b marks_;  ///< 1 where there are things with bands; 0 between calls
  cv::Rect around_;  ///< the region, and as much beside it as is looked at
  std::vector<Follower> columns_;
  std::vector<Line> along_;
  std::vector<cv::Rect> bands_;  ///< of one pixel across
  std::vector<Run> found_;
  int most_px_;
};

}  // namespace omnifleet::ground
