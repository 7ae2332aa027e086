#include "distance_vector/column_view.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::distance_vector {
namespace {

constexpr double kTurn_rad = 2.0 * M_PI;

}  // namespace

ColumnView::ColumnView(const lens::Camera& camera, const Options& options)
    : size_(camera.model().image_width_px, camera.model().image_height_px) {
  camera_height_m_ = static_cast<float>(camera.height());
  const auto columns = static_cast<std::size_t>(size_.width);
  inverse_m_.assign(columns * static_cast<std::size_t>(size_.height), 0.0f);
  bearing_rad_ = inverse_m_;
  horizon_.assign(columns, size_.height);
  limit_ = check_ = horizon_;
  sees_horizon_.assign(columns, 0);
  int seeing = 0;
  for (int u = 0; u < size_.width; ++u) {
    readColumn(camera, options, u);
    if (limitRow(u) + options.walk.min_run_px < size_.height) ++seeing;
  }
  if (10 * seeing < size_.width)
    throw options::Error(
        "position_m, rotation_rpy_deg: the camera does not look at the floor; a forward camera has a "
        "rotation of "
        "[0, −90 + (downward pitch), 0] and a positive height");
}

void ColumnView::readColumn(const lens::Camera& camera, const Options& options, int u) {
  const auto column = static_cast<std::size_t>(u), base = column * static_cast<std::size_t>(size_.height);
  double last_bearing = 0.0;
  int v = size_.height - 1;
  for (; v >= 0; --v) {
    const auto floor = camera.floorFromPixel({static_cast<double>(u), static_cast<double>(v)});
    if (!floor) break;
    const Eigen::Vector2d from_foot = *floor - camera.foot();
    const double range_m = from_foot.norm();
    if (!(range_m > 1e-6)) break;
    double bearing = std::atan2(from_foot.y(), from_foot.x());
    if (v < size_.height - 1) bearing -= kTurn_rad * std::round((bearing - last_bearing) / kTurn_rad);
    // A ray that crosses the foot looks backwards: the column is of no use beyond.
    if (v < size_.height - 1 && std::abs(bearing - last_bearing) > 0.5) break;
    last_bearing = bearing;
    inverse_m_[base + static_cast<std::size_t>(v)] = static_cast<float>(1.0 / range_m);
    bearing_rad_[base + static_cast<std::size_t>(v)] = static_cast<float>(bearing);
  }
  const int horizon = v + 1;
  if (horizon >= size_.height) return;
  horizon_[column] = horizon;  // inverseRange() needs it
  blind_m_ =
      std::max(blind_m_, 1.0 / static_cast<double>(inverseRange(u, static_cast<float>(size_.height - 1))));
  const bool above = horizon > 0;  // the image shows what is above the floor
  int limit = horizon + (above ? static_cast<int>(std::ceil(options.walk.horizon_px)) : 0);
  const auto nearest = static_cast<float>(1.0 / options.max_range_m);
  while (limit < size_.height - 1 && inverseRange(u, static_cast<float>(limit)) < nearest) ++limit;
  limit_[column] = std::min(limit, size_.height - 1);
  check_[column] = std::max(0, horizon - static_cast<int>(std::ceil(options.walk.check_px)));
  sees_horizon_[column] = horizon - check_[column] >= options.walk.min_run_px ? 1 : 0;
}

float ColumnView::mixed(const std::vector<float>& table, int u, float v) const {
  const float row = std::clamp(v, static_cast<float>(horizonRow(u)), static_cast<float>(size_.height - 1));
  const int top = std::min(static_cast<int>(row), size_.height - 2);
  const float f = row - static_cast<float>(top);
  const auto at =
      static_cast<std::size_t>(u) * static_cast<std::size_t>(size_.height) + static_cast<std::size_t>(top);
  return (1.0f - f) * table[at] + f * table[at + 1];
}

float ColumnView::slope(int u, float v) const {
  const float low = std::max(v - 0.5f, static_cast<float>(horizonRow(u))),
              high = std::min(v + 0.5f, static_cast<float>(size_.height - 1));
  return high > low ? (inverseRange(u, high) - inverseRange(u, low)) / (high - low) : 0.0f;
}

}  // namespace omnifleet::distance_vector
