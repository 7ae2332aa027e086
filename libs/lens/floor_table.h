#pragma once

#include <Eigen/Core>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::lens {

/// Floor point per pixel from a table, for contours. The lens is evaluated once per camera, on a lattice. The
/// table stores rays (parent frame, float), which are smooth up to and beyond the horizon, where floor points
/// tend to infinity. Between lattice points the ray is interpolated bilinearly and then intersected with the
/// plane. tests/unit/lens/floor_table_test.cpp measures the error against Camera::planeFromPixel.
class FloorTable {
 public:
  /// `step_px`: spacing of the lattice points (16 bytes each). The error grows with its square: below 0.01 px
  /// for 4, below 0.04 px for 8 (1280×960, up to 4 m, camera at 0.5 m).
  explicit FloorTable(const Camera& camera, int step_px = 4);

  /// Point of the plane z = plane_height_m in the parent frame, metres, at any sub-pixel position. NaN above
  /// the horizon, outside the image or outside the field of view.
  Eigen::Vector2f at(float u_px, float v_px, float plane_height_m = 0.0f) const;

  /// Prefetches the entries that at() needs.
  void prefetch(float u_px, float v_px) const;

  /// Ray in the parent frame, of unit length within the accuracy of the table. NaN outside the field of view.
  Eigen::Vector3f ray(float u_px, float v_px) const;

 private:
  Eigen::Vector4f exact(float u_px, float v_px) const;
  Eigen::Vector4f mixed(float u_px, float v_px) const;

  Camera camera_;
  int step_px_, columns_, rows_;
  float inverse_step_;
  Eigen::Vector3f position_m_;
  std::vector<Eigen::Vector4f> rays_;  ///< x, y, z, 0 (one SSE register); NaN outside the field of view
};

}  // namespace omnifleet::lens
