#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Light reflected by the floor at any position. Slow components (colour, clouds, light, contact shadows) are
/// on a coarse grid. Fine components (texture, grid lines) are on a periodic tile with coarser levels for
/// distant pixels.
class FloorMap {
 public:
  static constexpr int kLevels = 8;

  FloorMap(const Arena& arena, std::uint32_t seed);

  /// Updates the contact shadows of solids that have moved.
  void update(const Arena& arena, double time_s);

  /// Level of the tile whose texels match a pixel with this footprint on the floor.
  std::uint8_t levelFor(float footprint_m) const;

  /// Blue, green, red (and 0) in grey levels, bilinear. Without shadows cast by the sun.
  Eigen::Array4f at(float x_m, float y_m, std::uint8_t level) const;

 private:
  struct Texel {
    float texture;  ///< factor of the fine variation
    float grid;     ///< share of the texel that grid lines occupy
  };
  void makeTile(const Floor& floor);
  Eigen::Vector2f placeOf(int row, int column) const;
  void makeLevels(const Arena& arena);
  void addContactShadow(const Arena& arena, std::size_t solid);
  void makeCoarse(const Floor& floor);
  Eigen::Array4f coarseAt(float x_m, float y_m) const;
  Texel tileAt(float x_m, float y_m, std::uint8_t level) const;
  /// Brightness factor of the field between grid lines at a position.
  float fieldAt(float x_m, float y_m) const;

  std::uint32_t seed_;
  int tile_texels_ = 1024;
  float texel_m_ = 0.003f;
  bool has_grid_ = false;
  float grid_m_ = 0.0f, tile_variation_ = 0.0f;
  Eigen::Array4f grid_ratio_ = Eigen::Array4f::Ones();  ///< colour of a line divided by that of the floor
  std::vector<Texel> tile_[kLevels];
  int columns_ = 0, rows_ = 0;
  Eigen::Vector2f origin_m_{0.0f, 0.0f};
  std::vector<Eigen::Array4f, Eigen::aligned_allocator<Eigen::Array4f>> coarse_;
  std::vector<double> levels_;  ///< per cell: light and clouds, without contact shadows
  std::vector<Pose2> solids_;   ///< poses of the solids for which the shadows are computed
  std::vector<std::vector<double>> contact_shadows_;  ///< per solid and cell: share of light beside the solid
};

}  // namespace omnifleet::synthetic
