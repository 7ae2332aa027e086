#include "tests/raycast/arena_camera.h"

#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>

namespace omnifleet::raycast {
namespace {

/// Fixed-point iteration of the distortion from a guess; converges for the distortions of this generator.
Eigen::Vector2d undistorted(const Eigen::Vector2d& distorted, const std::array<double, 5>& k,
                            Eigen::Vector2d p) {
  for (int turn = 0; turn < 60; ++turn) {
    const double s = p.squaredNorm(), radial = 1.0 + s * (k[0] + s * (k[1] + s * k[4]));
    const Eigen::Vector2d shift(2.0 * k[2] * p.x() * p.y() + k[3] * (s + 2.0 * p.x() * p.x()),
                                k[2] * (s + 2.0 * p.y() * p.y()) + 2.0 * k[3] * p.x() * p.y());
    const Eigen::Vector2d next = (distorted - shift) / radial;
    if ((next - p).norm() < 1e-8) return next;
    p = next;
  }
  return p;
}

cv::Rect_<float> around(const Eigen::Vector2f& low, const Eigen::Vector2f& high) {
  return {low.x(), low.y(), high.x() - low.x(), high.y() - low.y()};
}

}  // namespace

ArenaCamera::ArenaCamera(const lens::CameraModel& model)
    : columns_(model.image_width_px),
      rows_(model.image_height_px),
      tile_columns_((columns_ + kTile_px - 1) / kTile_px),
      tile_rows_((rows_ + kTile_px - 1) / kTile_px),
      parent_from_camera_(model.parentFromCamera()) {
  if (model.projection != lens::Projection::kPinhole || model.distortion.size() > 5)
    throw std::invalid_argument("ArenaCamera: a pinhole camera with at most 5 distortion values is required");
  std::array<double, 5> k{};
  std::copy(model.distortion.begin(), model.distortion.end(), k.begin());
  rays_.resize(static_cast<std::size_t>(columns_ * rows_ * kSamples * kSamples));
  const float far = std::numeric_limits<float>::max();
  std::vector<Eigen::Vector2f> low(static_cast<std::size_t>(tile_columns_ * tile_rows_), {far, far}),
      high(low.size(), {-far, -far});
  std::size_t n = 0;
  for (int y = 0; y < rows_ * kSamples; ++y) {
    Eigen::Vector2d guess = Eigen::Vector2d::Zero();
    for (int x = 0; x < columns_ * kSamples; ++x, ++n) {
      const Eigen::Vector2d pixel((x + 0.5) / kSamples - 0.5, (y + 0.5) / kSamples - 0.5);
      const Eigen::Vector2d off = (pixel - model.principal_point_px).cwiseQuotient(model.focal_px);
      guess = undistorted(off, k, guess);
      rays_[n] = guess.cast<float>();
      const auto tile =
          static_cast<std::size_t>(y / kSamples / kTile_px * tile_columns_ + x / kSamples / kTile_px);
      low[tile] = low[tile].cwiseMin(rays_[n]);
      high[tile] = high[tile].cwiseMax(rays_[n]);
    }
  }
  for (std::size_t t = 0; t < low.size(); ++t) tiles_.push_back(around(low[t], high[t]));
}

std::optional<cv::Rect_<float>> ArenaCamera::boundsOf(const std::vector<Eigen::Vector3d>& corners_in_camera) {
  constexpr double kNearest_m = 1e-3;
  const float far = std::numeric_limits<float>::max();
  Eigen::Vector2f low(far, far), high(-far, -far);
  for (const Eigen::Vector3d& corner : corners_in_camera) {
    if (corner.z() < kNearest_m) return std::nullopt;
    const Eigen::Vector2f ray = (corner.head<2>() / corner.z()).cast<float>();
    low = low.cwiseMin(ray);
    high = high.cwiseMax(ray);
  }
  return around(low, high);
}

}  // namespace omnifleet::raycast
