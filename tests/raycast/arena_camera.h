#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::raycast {

/// Rays of a pinhole camera with distortion (OpenCV's k1, k2, p1, p2, k3), computed independently of
/// lens::Lens. A ray is (x, y, 1) in the optical frame.
class ArenaCamera {
 public:
  static constexpr int kSamples = 4;  ///< per pixel and axis
  static constexpr int kTile_px = 8;

  explicit ArenaCamera(const lens::CameraModel& model);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  /// Ray of sample (i, j) of a pixel; i, j in [0, kSamples).
  const Eigen::Vector2f& ray(int u, int v, int i, int j) const {
    return rays_[static_cast<std::size_t>(((v * kSamples + j) * columns_ + u) * kSamples + i)];
  }
  const Eigen::Isometry3d& parentFromCamera() const { return parent_from_camera_; }
  int tileColumns() const { return tile_columns_; }
  int tileRows() const { return tile_rows_; }
  /// Rectangle of ray coordinates that contains all rays of a tile.
  const cv::Rect_<float>& tile(int column, int row) const {
    return tiles_[static_cast<std::size_t>(row * tile_columns_ + column)];
  }
  /// Rectangle of ray coordinates that contains a convex body; empty if a corner lies beside or behind the
  /// camera, where no such rectangle exists.
  static std::optional<cv::Rect_<float>> boundsOf(const std::vector<Eigen::Vector3d>& corners_in_camera);

 private:
  int columns_, rows_, tile_columns_, tile_rows_;
  Eigen::Isometry3d parent_from_camera_;
  std::vector<Eigen::Vector2f> rays_;
  std::vector<cv::Rect_<float>> tiles_;
};

}  // namespace omnifleet::raycast
