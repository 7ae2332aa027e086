#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "distance_vector/options.h"
#include "lens/camera.h"

namespace omnifleet::distance_vector {

/// The floor as each image column sees it, from the calibration. Row and column are pixel coordinates (v and
/// u). Inverse range and bearing are about the foot of the camera, in base_link axes.
class ColumnView {
 public:
  /// Throws options::Error if less than a tenth of the columns sees floor.
  ColumnView(const lens::Camera& camera, const Options& options);

  cv::Size size() const { return size_; }
  /// 1/m at a sub-pixel row, at most bottom and at least horizonRow(u).
  float inverseRange(int u, float v) const { return mixed(inverse_m_, u, v); }
  /// rad, −π to π, continuous within a column.
  float bearing(int u, float v) const { return mixed(bearing_rad_, u, v); }
  /// Change of the inverse range per pixel downwards, 1/m.
  float slope(int u, float v) const;

  /// Uppermost row of the column that sees floor; the image height where none does.
  int horizonRow(int u) const { return horizon_[static_cast<std::size_t>(u)]; }
  /// Farthest row that is measured: `horizon_px` below the horizon, or at max_range_m.
  int limitRow(int u) const { return limit_[static_cast<std::size_t>(u)]; }
  /// Row up to which floor-like pixels are followed; 0 at least.
  int checkRow(int u) const { return check_[static_cast<std::size_t>(u)]; }
  /// True if the image shows what is above the horizon in this column, so that floor can be rejected there.
  bool seesHorizon(int u) const { return sees_horizon_[static_cast<std::size_t>(u)] != 0; }
  /// m, of the camera above the floor.
  float cameraHeight() const { return camera_height_m_; }
  /// Largest distance (m) of the bottom row: nearer floor is hidden in at least one direction.
  double blindM() const { return blind_m_; }

 private:
  float mixed(const std::vector<float>& table, int u, float v) const;
  void readColumn(const lens::Camera& camera, const Options& options, int u);

  cv::Size size_;
  std::vector<float> inverse_m_, bearing_rad_;  ///< column by column, [u·height + v]
  std::vector<int> horizon_, limit_, check_;
  std::vector<unsigned char> sees_horizon_;
  double blind_m_ = 0.0;
  float camera_height_m_ = 0.0f;
};

}  // namespace omnifleet::distance_vector
