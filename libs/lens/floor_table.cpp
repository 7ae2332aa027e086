#include "lens/floor_table.h"

#include <cmath>
#include <limits>

namespace omnifleet::lens {
namespace {
const float kNaN = std::numeric_limits<float>::quiet_NaN();
}

FloorTable::FloorTable(const Camera& camera, int step_px) : camera_(camera), step_px_(step_px) {
  if (step_px < 1) throw options::Error("FloorTable: step_px must be at least 1");
  // Pixel i covers [i − 0.5, i + 0.5]: the lattice starts one pixel before the first and ends behind the
  // last.
  columns_ = (camera.model().image_width_px + step_px) / step_px + 2;
  rows_ = (camera.model().image_height_px + step_px) / step_px + 2;
  inverse_step_ = 1.0f / static_cast<float>(step_px);
  rays_.reserve(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      rays_.push_back(exact(static_cast<float>(column * step_px - 1), static_cast<float>(row * step_px - 1)));
    }
  }
}

Eigen::Vector3f FloorTable::exact(float u_px, float v_px) const {
  const auto ray = camera_.rayFromPixel({u_px, v_px});
  return ray ? Eigen::Vector3f(ray->cast<float>()) : Eigen::Vector3f(kNaN, kNaN, kNaN);
}

Eigen::Vector3f FloorTable::ray(float u_px, float v_px) const {
  const float x = (u_px + 1.0f) * inverse_step_, y = (v_px + 1.0f) * inverse_step_;
  if (!(x >= 0.0f && y >= 0.0f && x < static_cast<float>(columns_ - 1) &&
        y < static_cast<float>(rows_ - 1))) {
    return {kNaN, kNaN, kNaN};
  }
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float a = x - static_cast<float>(column), b = y - static_cast<float>(row);
  const Eigen::Vector3f* upper = &rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                                        static_cast<std::size_t>(column)];
  const Eigen::Vector3f* lower = upper + columns_;
  const Eigen::Vector3f mixed =
      (1.0f - b) * ((1.0f - a) * upper[0] + a * upper[1]) + b * ((1.0f - a) * lower[0] + a * lower[1]);
  return std::isnan(mixed.z()) ? exact(u_px, v_px) : mixed;  // at the edge of the field of view
}

Eigen::Vector2f FloorTable::at(float u_px, float v_px, float plane_height_m) const {
  const Eigen::Vector3f direction = ray(u_px, v_px);
  const Eigen::Vector3d& position = camera_.model().position_m;
  const float along = (plane_height_m - static_cast<float>(position.z())) / direction.z();
  if (!(along > 0.0f) || std::isinf(along)) return {kNaN, kNaN};
  return position.head<2>().cast<float>() + along * direction.head<2>();
}

}  // namespace omnifleet::lens
