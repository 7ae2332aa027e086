#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace omnifleet::ahmed {

/// What one run on one recording reached. NaN: not measured.
struct RunFigures {
  double faces_occupied = 0.0;  ///< share of the faces seen within 1.8 m
  double within_1_5cm = 0.0;    ///< share of the occupied cells within 1.5 cm of a true face
  double near_error_m = 0.0,
         far_error_m = 0.0;  ///< of cells at faces that a robot saw within 1 m, and of others
  double per_crossed = 0.0;  ///< occupied cells per cell that a face crosses
  double on_robots = 0.0;    ///< occupied cells that lay in a robot's body at any time
  double free_complete = 0.0,
         free_wrong = 0.0;  ///< share of the floor that is free; of the free cells that are wrong
  double position_m = 0.0, heading_rad = 0.0;  ///< mean errors of the mapping robots' poses
  double sent_bytes_per_s = 0.0;               ///< per mapping robot and second of recorded time
  double recorded_s = 0.0;

  /// Reads metrics.json and the logs of a run, and the times of its recording. Throws std::runtime_error.
  static RunFigures load(const std::string& run, const std::string& recording);
};

/// Runs of one seed: by the name of their folder, e.g. "literal", "omnifleet", "stale/literal".
struct SeedFigures {
  std::uint32_t seed = 0;
  std::map<std::string, RunFigures> runs;

  /// The runs in OUT/seed_N whose metrics.json exists.
  static SeedFigures load(const std::string& out, std::uint32_t seed);
};

/// Rows of the table that grows while seeds finish: two lines for the heading, one line per method.
std::string heading();
std::string rows(const SeedFigures& seed);

/// Table of all seeds: what the paper reports, then median and worst of literal and omnifleet. Then the cost
/// of a stale heading, from the seeds that have such runs.
std::string report(const std::vector<SeedFigures>& seeds);

}  // namespace omnifleet::ahmed
