#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Light that the floor sends back at any place: slow parts (colour, clouds, light, contact shadows) on a
/// coarse grid, fine parts (grain, grid lines) on a periodic tile with coarser and coarser versions for far
/// pixels.
class FloorMap {
 public:
  static constexpr int kLevels = 8;

  FloorMap(const Arena& arena, std::uint32_t seed);

  /// Recomputes the contact shadows where solids have moved since.
  void update(const Arena& arena, double time_s);

  /// Version of the tile whose texels match a pixel that covers so much floor.
  std::uint8_t levelFor(float footprint_m) const;

  /// Blue, green, red (and 0) in grey levels, bilinear, without shadows thrown by the sun.
  Eigen::Array4f at(float x_m, float y_m, std::uint8_t level) const;

 private:
  struct Texel {
    float grain;  ///< factor
    float grid;   ///< share covered by grid lines
  };
  void makeTile(const Floor& floor);
  Eigen::Vector2f placeOf(int row, int column) const;
  void makeLevels(const Arena& arena);
  void shade(const Arena& arena, std::size_t solid);
  void makeCoarse(const Floor& floor);
  Eigen::Array4f coarseAt(float x_m, float y_m) const;
  Texel tileAt(float x_m, float y_m, std::uint8_t level) const;
  /// Factor of the field between grid lines that holds a place.
  float fieldAt(float x_m, float y_m) const;

  std::uint32_t seed_;
  int tile_texels_ = 1024;
  float texel_m_ = 0.003f;
  bool has_grid_ = false;
  float grid_m_ = 0.0f, tile_variation_ = 0.0f;
  Eigen::Array4f grid_ratio_ = Eigen::Array4f::Ones();  ///< colour of a line over that of the floor
  std::vector<Texel> tile_[kLevels];
  int columns_ = 0, rows_ = 0;
  Eigen::Vector2f origin_m_{0.0f, 0.0f};
  std::vector<Eigen::Array4f, Eigen::aligned_allocator<Eigen::Array4f>> coarse_;
  std::vector<double> levels_;  ///< per cell: light and clouds, without what the solids do to them
  std::vector<Pose2> solids_;   ///< where they stood when the shadows were computed
  std::vector<std::vector<double>> shades_;  ///< per solid and cell: what is left of the light beside it
};

}  // namespace omnifleet::synthetic
