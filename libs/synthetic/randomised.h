#pragma once

#include <cstdint>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// What a seed may change in an arena: the section `random:` of its file.
struct Randomisation {
  Eigen::Vector2d obstacles{5, 8};       ///< minimum and maximum number
  Eigen::Vector2d size_m{0.16, 0.40};    ///< m, sides of boxes, diameters of cylinders
  Eigen::Vector2d height_m{0.10, 0.26};  ///< m
  double passage_m = 0.65;               ///< m, free distance between obstacles and to walls
  double start_free_m = 0.30;  ///< m, free distance around the bodies at their initial and goal positions
  double near_m = 1.3;         ///< m, maximum distance of an obstacle from the way of the robots
  std::vector<Eigen::Vector2d>
      way;  ///< map, way of the robots; empty: from the initial position over all waypoints
  double start_jitter_m = 0.05;             ///< m, maximum shift of an initial pose, per axis
  double start_jitter_rad = 0.15;           ///< rad, maximum rotation of an initial pose
  Eigen::Vector2d floor_level{95, 205};     ///< grey levels
  double floor_tint = 0.10;                 ///< 1, maximum deviation of a colour channel from the floor level
  Eigen::Vector2d clouds{0.01, 0.08};       ///< 1
  Eigen::Vector2d texture{0.01, 0.06};      ///< 1
  Eigen::Vector2d light_level{0.70, 1.10};  ///< 1
  double light_gradient_per_m = 0.06;       ///< 1/m, maximum, in any direction
  double light_spot = 0.25;                 ///< 1, maximum brightness of the spot
  double contact_shadow = 0.30;             ///< 1, maximum darkening
  double cast_shadow = 0.0;                 ///< 1, maximum darkening
  Eigen::Vector2d tile_m{0.0, 0.0};         ///< m, spacing of the grid lines; 0: as in the arena
  Eigen::Vector2d tile_line_m{0.0015, 0.004};  ///< m, width of the grid lines
  double tile_line_contrast = 0.45;  ///< 1, maximum difference of the lines to the floor: darker by up to
                                     ///< this, brighter by half of it
  double tile_variation = 0.0;       ///< 1, maximum variation of the fields between grid lines
  Eigen::Vector2d noise{1.0, 2.5};   ///< grey levels
  double dull_share = 0.15;          ///< 1, share of obstacles with a greyish colour (not that of the floor)
  double floor_like_share =
      0.0;  ///< 1, share of obstacles with the colour of the floor, up to 20 % brighter or darker

  static Randomisation read(const options::Section& section);
};

/// Varies obstacles, colours, light and initial poses of an arena by the seed. Equal seeds give equal arenas
/// on every machine. Moves of obstacles are removed; walls and the places of fixed obstacles
/// stay. Throws options::Error when the section is
/// invalid or there is no room for the minimum number of obstacles.
Arena randomised(const Arena& arena, std::uint32_t seed);

}  // namespace omnifleet::synthetic
