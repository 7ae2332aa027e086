#pragma once

// Choi et al. 2014, §V.1 and §V.2, in the arenas of one seed. Each recording is replayed with the method as
// printed ("literal", config/papers/choi.yaml) and with the default options ("omnifleet"), and compared with
// the truth.

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dataset/trajectory_files.h"
#include "result.h"

namespace omnifleet::choi {

struct SeedOptions {
  std::uint32_t seed = 1000;
  std::string config;        ///< path of the folder config/
  std::string folder;        ///< folder of this seed; created if missing
  double image_scale = 1.0;  ///< factor on the image size of all cameras; 1: 1280×960 as in the paper
  double duration_s = 0.0;   ///< s, longest drive in §V.2; 0: duration of the arena
  std::string figures;       ///< folder for the figures; empty: none
  bool keep = false;         ///< keep the recordings and runs
};

using Paths = std::map<std::string, std::vector<dataset::StampedPose>>;

/// Folders and paths of one seed, from which its figures are drawn.
struct SeedData {
  std::string fixed, moving;                  ///< recordings of §V.1 and §V.2, robots only
  std::string fixed_ceiling, moving_ceiling;  ///< recordings of their ceiling cameras; empty: none
  std::map<std::string, std::string> fixed_runs, moving_runs;  ///< by method
  std::string overlay;                                         ///< config/papers/choi.yaml
  Paths ceiling;                                               ///< paths from the ceiling tracker
};

/// Describes everything that the result depends on: options and a digest of configuration and program.
std::string settingsOf(const SeedOptions& options);

/// Calls `progress` with the name of each step. Throws options::Error and std::runtime_error.
SeedResult runSeed(const SeedOptions& options, const std::function<void(const std::string&)>& progress);

}  // namespace omnifleet::choi
