#pragma once

#include <cstdint>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// What a seed may change of an arena: the `random:` section of its file.
struct Randomisation {
  Eigen::Vector2d obstacles{5, 8};       ///< fewest and most
  Eigen::Vector2d size_m{0.16, 0.40};    ///< m, sides of boxes, diameters of cylinders
  Eigen::Vector2d height_m{0.10, 0.26};  ///< m
  double passage_m = 0.65;               ///< m, free between any two obstacles, and to walls
  double start_free_m = 0.30;            ///< m, free about the bodies where they start and arrive
  double near_m = 1.3;                   ///< m, no obstacle is farther from every robot's way
  std::vector<Eigen::Vector2d> way;      ///< map, the robots' way; empty: from the starts over all waypoints
  double start_jitter_m = 0.05;          ///< m, starts move by up to this …
  double start_jitter_rad = 0.15;        ///< rad, … and turn by up to this
  Eigen::Vector2d floor_level{95, 205};  ///< grey levels
  double floor_tint = 0.10;              ///< 1, of a floor's colour channels against their mean
  Eigen::Vector2d clouds{0.01, 0.08};    ///< 1
  Eigen::Vector2d grain{0.01, 0.06};     ///< 1
  Eigen::Vector2d light_level{0.70, 1.10};     ///< 1
  double light_gradient_per_m = 0.06;          ///< 1/m, at most, in any direction
  double light_spot = 0.25;                    ///< 1, brightest spot
  double contact_shadow = 0.30;                ///< 1, darkest
  double cast_shadow = 0.0;                    ///< 1, darkest
  Eigen::Vector2d tile_m{0.0, 0.0};            ///< m, distance of the grid lines; 0: as the arena has them
  Eigen::Vector2d tile_line_m{0.0015, 0.004};  ///< m, their width
  double tile_line_contrast = 0.45;  ///< 1, lines are darker or lighter than the floor by up to this
  double tile_variation = 0.0;       ///< 1, at most, of the fields between them
  Eigen::Vector2d noise{1.0, 2.5};   ///< grey levels
  double dull_share = 0.15;          ///< 1, obstacles of a greyish colour (not that of the floor)
  double floor_like_share = 0.0;     ///< 1, obstacles of the floor's colour, up to a fifth off it

  static Randomisation read(const options::Section& section);
};

/// The same arena with obstacles, colours, light and starts of its own for each seed. Equal seeds give equal
/// arenas on every machine. Moves of obstacles are dropped, walls stay. Throws options::Error when the
/// section is wrong or there is no room for the fewest obstacles.
Arena randomised(const Arena& arena, std::uint32_t seed);

}  // namespace omnifleet::synthetic
