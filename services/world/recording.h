#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "synthetic/arena.h"
#include "world/world.h"

namespace omnifleet::world {

struct RecordingOptions {
  World::Options world;
  std::uint32_t seed = 1;         ///< seed of wheels, textures and sensor noise
  std::string extension = "png";  ///< png | jpg
  bool cameras = true;            ///< images of the fisheye and forward cameras
  bool ceiling = true;            ///< images of the ceiling cameras
};

/// Result of a simulated run.
struct RecordingReport {
  int frames = 0;
  bool arrived = false;  ///< all robots with a goal have arrived
  std::vector<World::Collision> collisions;
};

/// Drives the robots of an arena (world/drivers.h) and writes a complete dataset: all cameras, laser scans,
/// wheel speeds, markers and truth. Ends when all robots have arrived, or after the duration of the arena.
/// `progress(frame, frames)` is called after each frame. Throws std::runtime_error when a file cannot be
/// written, options::Error for an invalid arena.
RecordingReport record(const synthetic::Arena& arena, const RecordingOptions& options,
                       const std::string& folder, const std::function<void(int, int)>& progress = {});

}  // namespace omnifleet::world
