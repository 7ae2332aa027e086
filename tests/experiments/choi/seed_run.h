#pragma once

// Choi et al. 2014, §V.1 and §V.2 in one seed's arenas: recorded, replayed as printed ("literal",
// config/papers/choi.yaml) and as the house does it ("ours"), scored against the truth.

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "dataset/trajectory_files.h"
#include "result.h"

namespace omnifleet::choi {

struct SeedOptions {
  std::uint32_t seed = 1000;
  std::string config;        ///< the folder config/
  std::string folder;        ///< of this seed; created
  double image_scale = 1.0;  ///< 1, of all cameras; 1: the paper's 1280×960
  double duration_s = 0.0;   ///< s, at most, of the drive in §V.2; 0: the arena's
  std::string figures;       ///< folder for the figures; empty: none
  bool keep = false;         ///< leave the recordings and runs
};

using Paths = std::map<std::string, std::vector<dataset::StampedPose>>;

/// Where everything of one seed lies while its figures are drawn.
struct SeedData {
  std::string fixed, moving;                  ///< recordings of §V.1 and §V.2, robots alone
  std::string fixed_ceiling, moving_ceiling;  ///< their ceiling cameras; empty: none
  std::map<std::string, std::string> fixed_runs, moving_runs;  ///< by method
  std::string overlay;                                         ///< config/papers/choi.yaml
  Paths ceiling;                                               ///< what the ceiling tracker says
};

/// Names everything that the result depends on.
std::string settingsOf(const SeedOptions& options);

/// `say` is told what is being done. Throws options::Error, std::runtime_error.
SeedResult runSeed(const SeedOptions& options, const std::function<void(const std::string&)>& say);

}  // namespace omnifleet::choi
