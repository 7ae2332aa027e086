#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::synthetic {

/// What a pixel shows where no solid stands.
enum class Backdrop : std::uint8_t { kNothing, kFloor, kSky };

/// The constant part of a camera: one ray per pixel and the point where it meets the floor, both in the
/// parent frame of the camera. Each tile of 4×4 pixels, and each block of 8×8 tiles, has a cone that contains
/// its rays.
class PixelTable {
 public:
  static constexpr int kTile = 4;
  static constexpr int kBlock = 8;  ///< tiles per side
  struct Cone {
    Eigen::Vector3f axis = Eigen::Vector3f::Zero();
    float half_angle_rad = -1.0f;  ///< < 0: contains no ray
  };

  explicit PixelTable(const lens::Camera& camera);

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t index(int u, int v) const { return static_cast<std::size_t>(v) * width_ + u; }
  Eigen::Vector3f ray(int u, int v) const {
    const std::size_t i = index(u, v);
    return {x[i], y[i], z[i]};
  }

  /// Ray beside the centre of pixel (u, v), linear in the rays of the neighbouring pixels; |du|, |dv| ≤ ½.
  Eigen::Vector3f rayBeside(int u, int v, float du, float dv) const;

  std::vector<float> x, y, z;  ///< unit rays; zero outside the field of view
  std::vector<Backdrop> backdrop;
  std::vector<Eigen::Vector2f> floor_m;  ///< valid where the backdrop is floor
  std::vector<float> footprint_m;        ///< longer side of the pixel on the floor, times kFootprintShare
  std::vector<Cone> tiles, blocks;
  int tile_columns = 0, tile_rows = 0, block_columns = 0, block_rows = 0;

 private:
  void castRays(const lens::Camera& camera);
  void findFootprints();
  Cone coneOf(int u0, int v0, int u1, int v1) const;
  void makeCones();
  Eigen::Vector3f difference(int u, int v, int du, int dv) const;

  int width_, height_;
};

}  // namespace omnifleet::synthetic
