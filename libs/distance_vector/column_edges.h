#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "distance_vector/column_view.h"
#include "distance_vector/floor_colour.h"
#include "distance_vector/options.h"

namespace omnifleet::distance_vector {

/// Sub-pixel position of the edge in which the floor ends in one image column. The profile along the column
/// is projected onto luma (JPEG subsamples hue, which biases an edge in hue by 0.1 px) or onto the mixture of
/// colours that separates floor and object best against the floor's texture, whichever gives the smaller σ. A
/// straight line through the floor below the edge, over its range in metres, is extrapolated to it (light
/// that falls off would bias it otherwise), the plateau of 2–4 px above it is the object, and the area
/// between both within ±2 px places the edge. Repeated around the edge found.
class ColumnEdges {
 public:
  explicit ColumnEdges(const EdgeOptions& options) : options_(options) {}

  struct Edge {
    float row;       ///< pixels; the object is above it (smaller rows)
    float sigma_px;  ///< from the contrast, the pixel noise and the deviation of the floor from its line
  };
  /// @param bgr CV_8UC3 @param row first row that is no floor, roughly @param noise σ of a pixel, grey levels
  std::optional<Edge> find(const cv::Mat& bgr, const ColumnView& view, int u, int row, float noise,
                           const FloorSample& floor) const;

  /// σ of the noise of one pixel's luma, grey levels: second differences along columns of the floor.
  /// @param first_row, end_row rows that show floor in most columns
  float noise(const cv::Mat& bgr, int first_row, int end_row);

 private:
  struct Profile;
  std::optional<Edge> measure(const Profile& profile, int row, float noise, float fixed_px) const;

  EdgeOptions options_;
  std::array<int, 1024> counts_{};
};

}  // namespace omnifleet::distance_vector
