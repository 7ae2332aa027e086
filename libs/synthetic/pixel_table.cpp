#include "synthetic/pixel_table.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::synthetic {
namespace {

constexpr float kFarM = 200.0f;          // the floor beyond is rendered as sky
constexpr float kFootprintShare = 0.7f;  // some aliasing resembles a real sensor, stronger blur does not

}  // namespace

PixelTable::PixelTable(const lens::Camera& camera)
    : width_(camera.model().image_width_px), height_(camera.model().image_height_px) {
  castRays(camera);
  findFootprints();
  makeCones();
}

void PixelTable::castRays(const lens::Camera& camera) {
  const std::size_t n = static_cast<std::size_t>(width_) * height_;
  x.assign(n, 0.0f);
  y.assign(n, 0.0f);
  z.assign(n, 0.0f);
  backdrop.assign(n, Backdrop::kNothing);
  floor_m.assign(n, Eigen::Vector2f::Zero());
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const auto ray = camera.rayFromPixel({static_cast<double>(u), static_cast<double>(v)});
      if (!ray) continue;
      const std::size_t i = index(u, v);
      x[i] = static_cast<float>(ray->x());
      y[i] = static_cast<float>(ray->y());
      z[i] = static_cast<float>(ray->z());
      const double range_m = ray->z() < -1e-6 ? -camera.height() / ray->z() : 2.0 * kFarM;
      backdrop[i] = range_m < kFarM ? Backdrop::kFloor : Backdrop::kSky;
      if (range_m < kFarM) floor_m[i] = (camera.foot() + range_m * ray->head<2>()).cast<float>();
    }
  }
}

void PixelTable::findFootprints() {
  footprint_m.assign(backdrop.size(), 0.0f);
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const std::size_t i = index(u, v);
      if (backdrop[i] != Backdrop::kFloor) continue;
      float longest = 0.0f;
      if (u + 1 < width_ && backdrop[i + 1] == Backdrop::kFloor) {
        longest = std::max(longest, (floor_m[i + 1] - floor_m[i]).norm());
      }
      if (v + 1 < height_ && backdrop[i + width_] == Backdrop::kFloor) {
        longest = std::max(longest, (floor_m[i + width_] - floor_m[i]).norm());
      }
      footprint_m[i] =
          kFootprintShare * (longest > 0.0f || i == 0 ? longest : footprint_m[i - 1] / kFootprintShare);
    }
  }
}

PixelTable::Cone PixelTable::coneOf(int u0, int v0, int u1, int v1) const {
  Cone cone;
  for (int v = v0; v < std::min(v1, height_); ++v) {
    for (int u = u0; u < std::min(u1, width_); ++u) cone.axis += ray(u, v);
  }
  if (cone.axis.norm() < 1e-3f) return {};
  cone.axis.normalize();
  for (int v = v0; v < std::min(v1, height_); ++v) {
    for (int u = u0; u < std::min(u1, width_); ++u) {
      if (backdrop[index(u, v)] == Backdrop::kNothing) continue;
      cone.half_angle_rad =
          std::max(cone.half_angle_rad, std::acos(std::min(1.0f, cone.axis.dot(ray(u, v)))));
    }
  }
  // Extends the cone by the width of a pixel, so that both tiles see a contour between them.
  cone.half_angle_rad *= 1.0f + 2.0f / static_cast<float>(std::max(2, u1 - u0));
  return cone;
}

void PixelTable::makeCones() {
  tile_columns = (width_ + kTile - 1) / kTile;
  tile_rows = (height_ + kTile - 1) / kTile;
  block_columns = (tile_columns + kBlock - 1) / kBlock;
  block_rows = (tile_rows + kBlock - 1) / kBlock;
  for (int r = 0; r < tile_rows; ++r) {
    for (int c = 0; c < tile_columns; ++c) {
      tiles.push_back(coneOf(c * kTile, r * kTile, (c + 1) * kTile, (r + 1) * kTile));
    }
  }
  const int side = kTile * kBlock;
  for (int r = 0; r < block_rows; ++r) {
    for (int c = 0; c < block_columns; ++c) {
      blocks.push_back(coneOf(c * side, r * side, (c + 1) * side, (r + 1) * side));
    }
  }
}

Eigen::Vector3f PixelTable::difference(int u, int v, int du, int dv) const {
  const auto seen = [&](int uu, int vv) {
    return uu >= 0 && vv >= 0 && uu < width_ && vv < height_ && backdrop[index(uu, vv)] != Backdrop::kNothing;
  };
  const bool ahead = seen(u + du, v + dv), behind = seen(u - du, v - dv);
  if (ahead && behind) return 0.5f * (ray(u + du, v + dv) - ray(u - du, v - dv));
  if (ahead) return ray(u + du, v + dv) - ray(u, v);
  if (behind) return ray(u, v) - ray(u - du, v - dv);
  return Eigen::Vector3f::Zero();
}

Eigen::Vector3f PixelTable::rayBeside(int u, int v, float du, float dv) const {
  return ray(u, v) + du * difference(u, v, 1, 0) + dv * difference(u, v, 0, 1);
}

}  // namespace omnifleet::synthetic
