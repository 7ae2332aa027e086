#pragma once

#include <string>

#include "lens/camera.h"
#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

enum class Light {
  kSoft,     ///< two lamps without cast shadows; contact shadows at the foot of obstacles
  kShadows,  ///< two lamps that cast shadows
  kOneLamp   ///< one lamp that casts shadows, weak ambient light; a linear camera with vignetting
};

struct RecordingOptions {
  unsigned seed = 0;  ///< of room, paths and noise
  Floor floor = Floor::kLino;
  lens::Projection projection = lens::Projection::kEquidistant;
  int robots = 3, obstacles = 8;
  int frames = 25;  ///< per robot, at 5 Hz
  int width_px = 640, height_px = 480;
  double light = 1.0;  ///< brightness; 1: bright
  Light lit_by = Light::kSoft;
  bool tape = false;  ///< two strips of yellow tape, 5 cm wide, through the room
  int sheets = 0;     ///< number of sheets of paper (A4) on the floor
};

/// Writes a data set with its truth. Light and dark robots drive random paths among obstacles whose colours
/// differ from the floor's. Each wheel has a constant scale error (σ 1 %) and noise per sample (σ 2 %).
/// Throws std::runtime_error if no free paths are found or a file cannot be written.
void record(const std::string& folder, const RecordingOptions& options);

}  // namespace omnifleet::raycast
