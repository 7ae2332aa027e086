#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::synthetic {

/// What a pixel looks at where no solid stands.
enum class Backdrop : std::uint8_t { kNothing, kFloor, kSky };

/// The fixed part of a camera: a ray per pixel, and where it meets the floor, all in the camera's parent
/// frame. Tiles of 4×4 pixels, in blocks of 8×8 tiles, know the cone that holds their rays.
class PixelTable {
 public:
  static constexpr int kTile = 4;
  static constexpr int kBlock = 8;  ///< tiles per side
  struct Cone {
    Eigen::Vector3f axis = Eigen::Vector3f::Zero();
    float half_angle_rad = -1.0f;  ///< < 0: no ray in it
  };

  explicit PixelTable(const lens::Camera& camera);

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t index(int u, int v) const { return static_cast<std::size_t>(v) * width_ + u; }
  Eigen::Vector3f ray(int u, int v) const {
    const std::size_t i = index(u, v);
    return {x[i], y[i], z[i]};
  }

  /// Ray beside the centre of pixel (u, v), by the rays of its neighbours; |du|, |dv| ≤ ½.
  Eigen::Vector3f rayBeside(int u, int v, float du, float dv) const;

  std::vector<float> x, y, z;  ///< unit rays; zero where nothing is seen
  std::vector<Backdrop> backdrop;
  std::vector<Eigen::Vector2f> floor_m;  ///< where the backdrop is floor
  std::vector<float> footprint_m;        ///< floor that the pixel covers, along its longer side, shortened
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
