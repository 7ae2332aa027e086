#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "options/options.h"

namespace omnifleet::synthetic {

using dataset::Rgb;

/// The plane z = 0: a plain colour with slow and fine variation and optional grid lines (Choi et al. 2014
/// §V.1: 5 cm).
struct Floor {
  Eigen::Vector2d size_m{6.0, 5.0};  ///< m, centred on the origin of map; the texture continues beyond
  Rgb rgb{168, 162, 150};            ///< colour in full light
  double clouds = 0.05;              ///< 1, amplitude of the slow variation relative to the colour
  double cloud_size_m = 0.5;         ///< m
  double texture = 0.03;             ///< 1, amplitude of the fine variation
  double texture_size_m = 0.006;     ///< m
  double grid_m = 0.0;               ///< m, spacing of the grid lines; 0: none
  double grid_width_m = 0.003;       ///< m
  Rgb grid_rgb{90, 90, 95};
  double tile_variation = 0.0;  ///< 1, maximum brightness difference of the fields between grid lines

  static Floor read(const options::Section& section);
};

/// Light that varies over the room. 1 is full light.
struct Light {
  double level = 1.0;                        ///< 1, at the origin
  Eigen::Vector2d gradient_per_m{0.0, 0.0};  ///< 1/m
  double spot = 0.0;                 ///< 1, brightness added at the centre of a round spot (may be negative)
  Eigen::Vector2d spot_m{0.0, 0.0};  ///< m
  double spot_size_m = 1.0;          ///< m, σ of the spot
  double flicker = 0.0;              ///< 1, amplitude of a slow variation over time
  double flicker_period_s = 7.0;     ///< s
  double ambient = 0.6;              ///< 1, share of ambient light; the rest is from `sun`
  Eigen::Vector3d sun{0.4, 0.3, 1.0};  ///< direction towards the lamp
  double contact_shadow = 0.0;         ///< 1, darkening of the floor next to an obstacle
  double contact_shadow_m = 0.08;      ///< m, decay distance
  double cast_shadow = 0.0;            ///< 1, darkening of the floor where obstacles and robots block `sun`
  double cast_softness = 0.15;         ///< 1, width of the rim of a shadow per height that casts it

  /// Brightness at a position of the floor and a time, at least 0.05 before flicker.
  double at(const Eigen::Vector2d& place_m, double time_s) const;

  static Light read(const options::Section& section);
};

enum class SolidKind { kBox, kCylinder };

/// An upright solid on the floor. size_m of a box is along its own x and y.
struct Solid {
  SolidKind kind = SolidKind::kBox;
  Pose2 map_from_solid;
  Eigen::Vector2d size_m{0.2, 0.2};  ///< box
  double radius_m = 0.1;             ///< cylinder
  double height_m = 0.2;
  Rgb rgb{200, 60, 50};
  double texture = 0.25;  ///< 1, amplitude of the surface variation
  bool wall = false;      ///< walls are not obstacles of scene.geojson
  bool fixed = false;     ///< a seed keeps the place of this obstacle, and varies its colour and height

  /// Footprint in map, counter-clockwise. A cylinder is a 96-gon of equal area.
  Polygon footprint() const { return footprintAt(map_from_solid); }
  Polygon footprintAt(const Pose2& map_from_solid_then) const;
  /// Exact distance from a position to the footprint, metres. Negative inside.
  double distance(const Eigen::Vector2d& place_m, const Pose2& map_from_solid_then) const;
  /// The same distance for a position in the axes of the solid.
  double distance(const Eigen::Vector2d& place_in_solid_m) const;

  static Solid read(const options::Section& section);
};

/// Model of the image sensor.
struct ImageFormation {
  double gain = 1.0;         ///< 1, exposure
  double noise = 1.5;        ///< grey levels, σ of the noise that is independent of brightness
  double shot_noise = 0.06;  ///< √(grey levels); σ² increases by its square per grey level
  double blur_px = 0.0;      ///< px, σ of a Gaussian blur
  double vignetting = 0.0;   ///< 1, darkening at the edge of the image circle
  int edge_samples = 4;      ///< rays per axis in a contour pixel

  static ImageFormation read(const options::Section& section);
};

}  // namespace omnifleet::synthetic
