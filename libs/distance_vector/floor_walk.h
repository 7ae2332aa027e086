#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "distance_vector/column_view.h"
#include "distance_vector/floor_colour.h"
#include "distance_vector/smoothed_image.h"

namespace omnifleet::distance_vector {

/// What ends the floor in an image column.
enum class End : std::uint8_t {
  kOutside,    ///< the column sees no floor
  kEdge,       ///< something that is no floor
  kFloorEnd,   ///< nothing up to the farthest row that is measured
  kUndecided,  ///< floor-like pixels beyond the horizon, or a band that is a shadow or a low object
  kNear        ///< no floor at the bottom of the image
};

struct ColumnEnd {
  End end = End::kOutside;
  int row = 0;    ///< first row (upwards) that is no floor; of kFloorEnd the farthest row that is measured
  int floor = 0;  ///< uppermost floor row, for the mask; the image height: none
  /// kEdge: so little of the floor behind it is hidden that it may be flat on the floor, and no other edge
  /// follows.
  bool low = false;
  bool beyond = false;  ///< kEdge: seen over an object that is low or flat
  bool weak = false;    ///< kEdge: no pixel shows it by itself, the whole column does (FloorSplit)
  /// kUndecided by a band that a shadow explains: first row (upwards) where floor-like pixels follow; −1: no
  /// band.
  int band_end = -1;
};

/// Walks all columns upwards from the bottom, row by row. Each column carries the expected colour: its hue
/// adapts slowly, its level follows light that falls off (a level and a slope per row). A pixel deviates in
/// hue (distance from the expected direction) or in level. A run of deviating pixels is a band:
/// - floor follows, and what stands at its near edge and hides the floor up to there is at most `flat_m`
///   high: a line, a seam or a flat card; the walk goes on;
/// - up to the horizon: an object. It begins where the first pixels are that no shadow explains (they
///   deviate in hue, are brighter than light_ratio, or darker than shadow_ratio), if what is before them is
///   darker floor;
/// - floor follows, no shadow explains it: an object. It may be flat if it hides at most largest_flat_m: the
///   walk goes on, because the next edge is valid in any case;
/// - floor follows, otherwise: undecided (a shadow, or a low object).
/// Floor in a shadow that follows an object counts as floor in the third rule: a card before a block and its
/// shadow. Floor-like pixels above the horizon are no floor, so such a column is undecided.
class FloorWalk {
 public:
  FloorWalk(const ColumnView& view, const WalkOptions& options);

  /// @return one entry per column, valid until the next call
  const std::vector<ColumnEnd>& walk(const SmoothedImage& image, const FloorSample& floor);

 private:
  enum class State : std::uint8_t { kFloor, kBand, kDone };
  struct Walker {
    float hue[3];
    float level, slope;       ///< expected at the next row, and its change per row
    float band_sum = 0.0f;    ///< of the levels of the band
    float before_sum = 0.0f;  ///< likewise, of its part before the object
    int begin = 0;            ///< first row of the band
    int flat = -1;            ///< row where the first low or flat object begins; −1: none so far
    int edge = 0;             ///< row where its object begins, once it is no line; −1 before
    int object_begin = 0;     ///< first row of the present run of pixels that no shadow explains
    int object_run = 0, object_count = 0, shadow_run = 0, floor_run = 0, count = 0, before = 0;
    State state = State::kFloor;
  };
  struct Deviation {
    bool hue, level;
    float along;
  };

  void begin(const SmoothedImage& image, const FloorSample& floor);
  void beginColumn(int u, float level, const FloorSample& floor);
  Deviation compare(const Walker& w, const float* colour, float expected, float tolerance) const;
  void stepFloor(int u, int v, const float* colour);
  static void beginBand(Walker& w, int v);
  void passFlat(int u, int v);
  void stepBand(int u, int v, const float* colour);
  void endBand(int u, int v);
  void finish(int u, End end, int row);
  void finishEdge(int u, End end, int row);
  void finishAtHorizon(int u);
  /// Metres of floor between two rows; infinite from the horizon upwards.
  float depth(int u, int below, int above) const;
  /// Height of an object (m) that begins at row `below` and hides the floor up to row `above`, at most.
  float heightBound(int u, int below, int above) const;
  bool isShadow(int u, const Walker& w) const;
  float levelTolerance(int u, int v, float level) const;

  const ColumnView* view_;
  WalkOptions options_;
  cv::Vec3f seed_{0, 0, 0};
  float hue_limit_ = 0.0f, level_limit_ = 0.0f;
  std::vector<Walker> walkers_;
  std::vector<ColumnEnd> ends_;
  std::vector<float> bottom_;
  std::vector<float> step_m_;  ///< metres of floor per row, [v·width + u]; large at the horizon
};

}  // namespace omnifleet::distance_vector
