#include "lens/floor_table.h"

#include <cmath>
#include <limits>

namespace omnifleet::lens {
namespace {
const float kNaN = std::numeric_limits<float>::quiet_NaN();
}

FloorTable::FloorTable(const Camera& camera, int step_px)
    : camera_(camera), step_px_(step_px), position_m_(camera.model().position_m.cast<float>()) {
  if (step_px < 1) throw options::Error("FloorTable: step_px must be at least 1");
  // Pixel i spans [i − 0.5, i + 0.5]. So the lattice begins one pixel before the first pixel and ends behind
  // the last.
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

Eigen::Vector4f FloorTable::exact(float u_px, float v_px) const {
  const auto ray = camera_.rayFromPixel({u_px, v_px});
  if (!ray) return Eigen::Vector4f::Constant(kNaN);
  return {static_cast<float>(ray->x()), static_cast<float>(ray->y()), static_cast<float>(ray->z()), 0.0f};
}

Eigen::Vector4f FloorTable::mixed(float u_px, float v_px) const {
  const float x = (u_px + 1.0f) * inverse_step_, y = (v_px + 1.0f) * inverse_step_;
  if (!(x >= 0.0f && y >= 0.0f && x < static_cast<float>(columns_ - 1) &&
        y < static_cast<float>(rows_ - 1))) {
    return Eigen::Vector4f::Constant(kNaN);
  }
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float a = x - static_cast<float>(column), b = y - static_cast<float>(row);
  const Eigen::Vector4f* upper = &rays_[static_cast<std::size_t>(row * columns_ + column)];
  const Eigen::Vector4f* lower = upper + columns_;
  const Eigen::Vector4f above = upper[0] + a * (upper[1] - upper[0]),
                        below = lower[0] + a * (lower[1] - lower[0]);
  const Eigen::Vector4f ray = above + b * (below - above);
  return std::isnan(ray.z()) ? exact(u_px, v_px) : ray;  // at the edge of the field of view
}

void FloorTable::prefetch(float u_px, float v_px) const {
  const float x = (u_px + 1.0f) * inverse_step_, y = (v_px + 1.0f) * inverse_step_;
  if (!(x >= 0.0f && y >= 0.0f && x < static_cast<float>(columns_ - 1) && y < static_cast<float>(rows_ - 1)))
    return;
  const Eigen::Vector4f* upper =
      &rays_[static_cast<std::size_t>(static_cast<int>(y) * columns_ + static_cast<int>(x))];
  __builtin_prefetch(upper);
  __builtin_prefetch(upper + columns_);
}

Eigen::Vector3f FloorTable::ray(float u_px, float v_px) const {
  return mixed(u_px, v_px).head<3>();
}

Eigen::Vector2f FloorTable::at(float u_px, float v_px, float plane_height_m) const {
  const Eigen::Vector4f direction = mixed(u_px, v_px);
  const float along = (plane_height_m - position_m_.z()) / direction.z();
  if (!(along > 0.0f && along < std::numeric_limits<float>::infinity())) return {kNaN, kNaN};
  return position_m_.head<2>() + along * direction.head<2>();
}

}  // namespace omnifleet::lens
