#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "synthetic/arena.h"
#include "world/world.h"

namespace omnifleet::world {

struct RecordingOptions {
  World::Options world;
  std::uint32_t seed = 1;         ///< of wheels, textures and sensor noise
  std::string extension = "png";  ///< png | jpg
  bool cameras = true;            ///< fisheye and forward pictures
  bool ceiling = true;            ///< ceiling pictures
};

/// What a run of the arena came to.
struct RecordingReport {
  int frames = 0;
  bool arrived = false;  ///< everybody who has a goal reached it
  std::vector<World::Collision> collisions;
};

/// Drives an arena (world/drivers.h) and writes it as a complete dataset: every camera, laser and wheel, markers,
/// truth. Ends when all have arrived or at the arena's duration. `progress(frame, frames)` is called after
/// each frame. Throws std::runtime_error where something cannot be written, options::Error for a wrong arena.
RecordingReport record(const synthetic::Arena& arena, const RecordingOptions& options,
                       const std::string& folder, const std::function<void(int, int)>& progress = {});

}  // namespace omnifleet::world
