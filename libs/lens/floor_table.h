#pragma once

#include <Eigen/Core>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::lens {

/// Floor point per pixel from a table, for contours: the lens is evaluated once per camera, on a lattice.
/// The table holds rays (in the parent frame, as float), which stay smooth up to and beyond the horizon where
/// floor points run to infinity; between lattice points the ray is interpolated bilinearly and then cut with
/// the plane. Error against Camera::planeFromPixel: see tests/unit/lens/floor_table_test.cpp.
class FloorTable {
 public:
  /// `step_px`: distance of the lattice points, 16 bytes each. The error falls with its square: 4 errs below
  /// 0.01 px, 8 below 0.04 px (1280×960, up to 4 m, camera at 0.5 m).
  explicit FloorTable(const Camera& camera, int step_px = 4);

  /// Point of the plane z = plane_height_m in the parent frame, metres; NaN above the horizon, outside the
  /// image or outside the field of view. Any sub-pixel position.
  Eigen::Vector2f at(float u_px, float v_px, float plane_height_m = 0.0f) const;

  /// Fetches what at() needs of the table.
  void prefetch(float u_px, float v_px) const;

  /// Unit-length ray in the parent frame (to the accuracy of the table); NaN where nothing is seen.
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
