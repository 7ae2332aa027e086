#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "distance_vector/column_view.h"
#include "distance_vector/floor_colour.h"
#include "distance_vector/smoothed_image.h"

namespace omnifleet::distance_vector {

/// The foot of an object that looks like the floor. If floor-like pixels of a column continue above the
/// horizon, the floor has ended somewhere below, although no pixel differs enough from the floor by itself.
/// The whole column then says where: of all splits into a part below and a part above, the one with the
/// largest difference of the mean colours across the floor's direction (maximum likelihood for one step in
/// noise of unknown σ). Shadows and light that falls off change the level, not this colour. The split counts
/// only if
/// - the step explains the column better than a colour that drifts (by `sigmas` σ): evenly if the floor is
///   known of earlier images, else as a cubic in the row, like the colour of the sky, and
/// - the difference is at least `sigmas` σ of the floor's own variation, and
/// - the part below looks more like the known floor than the part above.
class FloorSplit {
 public:
  FloorSplit(const ColumnView& view, const WalkOptions& options);

  /// @param floor the floor in this image @param known direction of the floor of earlier images, if it is
  /// that one
  void begin(const FloorSample& floor, const std::optional<cv::Vec3f>& known);
  /// @return first row (upwards) that is no floor; nothing if the column does not show where
  std::optional<int> find(const SmoothedImage& image, int u);
  /// Whether the pixels from `row` upwards look more like the part between `foot` and `row` than like the
  /// floor below `foot`. Of the column of the last find().
  bool continues(int foot, int row) const;

 private:
  /// Colours across the floor's direction, grey levels.
  struct Chroma {
    float first = 0.0f, second = 0.0f;
  };
  Chroma chroma(const cv::Vec3f& colour, float level) const;
  float driftGain(float rows, const Chroma& all) const;
  void readColumn(const SmoothedImage& image, int u, int top);
  Chroma mean(int bottom, int top) const;

  const ColumnView* view_;
  WalkOptions options_;
  cv::Vec3f direction_{0, 0, 0}, first_axis_{0, 0, 0}, second_axis_{0, 0, 0};
  bool is_known_ = false;
  Chroma known_;
  float level_ = 0.0f;        ///< of the floor
  float least_ = 0.0f;        ///< grey levels between floor and object
  std::vector<Chroma> sums_;  ///< over the rows from the bottom up to each row
  int bottom_ = 0, top_ = 0;  ///< rows of the column that sums_ holds
  float squares_ = 0.0f;
  std::array<Chroma, 3> moments_;  ///< Σ row^k · chroma of the column, rows scaled to ±1
};

}  // namespace omnifleet::distance_vector
