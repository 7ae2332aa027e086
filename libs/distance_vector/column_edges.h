#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "distance_vector/column_view.h"
#include "distance_vector/options.h"

namespace omnifleet::distance_vector {

/// Sub-pixel position of the edge in which the floor ends in one image column, twice: in the profile of luma,
/// and in that of the colour difference between object and floor, across the floor's own colour. A shadow is
/// darker floor of the same hue, so it moves the edge in luma towards the camera, and not the other one,
/// which has more noise (JPEG subsamples it). A straight line through the floor below the edge, over its
/// range in metres, is extrapolated to it (light that falls off would bias it otherwise), so is one
/// through 2–7 px of the object above it, and the area between both within ±2 px places the edge. Repeated
/// around the edge found.
class ColumnEdges {
 public:
  explicit ColumnEdges(const EdgeOptions& options) : options_(options) {}

  struct Edge {
    float row;       ///< pixels; the object is above it (smaller rows)
    float sigma_px;  ///< from the contrast, the pixel noise and the deviation of the floor from its line
    bool is_smooth = false;  ///< a colour that drifts explains the values around it as well
  };
  struct Pair {
    std::optional<Edge> luma, hue;
    bool weak = false;  ///< as given: no pixel of the column shows the boundary by itself
  };
  /// @param bgr CV_8UC3 @param row first row that is no floor, roughly @param weak the contrast may be
  /// lower than the least one, if it is clear in σ @param noise σ of a pixel, grey levels
  Pair find(const cv::Mat& bgr, const ColumnView& view, int u, int row, bool weak, float noise) const;

  /// σ of the noise of one pixel's luma, grey levels: second differences along columns of the floor.
  /// @param first_row, end_row rows that show floor in most columns
  float noise(const cv::Mat& bgr, int first_row, int end_row);

 private:
  struct Profile;
  /// @param noise σ of a value @param fixed_px σ that does not depend on the contrast @param least_contrast
  std::optional<Edge> measure(const Profile& profile, int row, float noise, float fixed_px,
                              float least_contrast) const;

  EdgeOptions options_;
  std::array<int, 1024> counts_{};
};

}  // namespace omnifleet::distance_vector
