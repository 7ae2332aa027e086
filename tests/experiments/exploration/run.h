#pragma once

#include <cstdint>
#include <string>

#include "tests/experiments/exploration/coverage.h"

namespace omnifleet::exploration {

/// What one exploration reached.
struct Outcome {
  std::uint32_t seed = 0;
  Coverage coverage;            ///< of the merged map
  double explored_share = 0.0;  ///< of the reachable floor, known in the robots' exploration grid
  bool ended = false;           ///< all robots reported that nothing reachable is unknown, and stood
  double time_s = 0.0;          ///< simulated, until then
  double gap_m =
      0.0;  ///< least true distance of the body of an exploring robot to a solid, a wall or a robot
  int collisions = 0;     ///< messages of the world
  int shared_frames = 0;  ///< frames in which two robots headed for one frontier
  int skipped = 0;        ///< frontiers that robots gave up
  double driven_m = 0.0;  ///< by all robots
};

/// Runs all stages of a fleet (arena.h) in this process, saves the map to OUT, and measures it with the truth
/// that the world has written. Throws std::runtime_error or options::Error.
Outcome explore(std::uint32_t seed, const std::string& fleet_file, const std::string& out);

std::string heading();
std::string row(const Outcome& outcome);

}  // namespace omnifleet::exploration
