#pragma once

#include <string>

#include "lens/camera.h"
#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

enum class Light {
  kSoft,     ///< two lamps, things darken the floor at their feet
  kShadows,  ///< the same lamps cast shadows
  kOneLamp   ///< casts shadows, little light from elsewhere; a linear camera that darkens to its rim
};

struct RecordingOptions {
  unsigned seed = 0;  ///< of the room, the ways and all noise
  Floor floor = Floor::kLino;
  lens::Projection projection = lens::Projection::kEquidistant;
  int robots = 3, things = 8, frames = 25;
  int width_px = 640, height_px = 480;
  double light = 1.0;
  Light lit_by = Light::kSoft;
  bool tape = false;  ///< two strips of yellow tape, 5 cm wide, through the room
  int sheets = 0;     ///< of paper on the floor
};

/// Robots, light and dark, drive at random among things of any colour but the floor's; wheels are off by one
/// per cent. Writes a data set with its truth. Throws std::runtime_error where no ways are found or a file
/// cannot be written.
void record(const std::string& folder, const RecordingOptions& options);

}  // namespace omnifleet::raycast
