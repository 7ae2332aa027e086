#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/experiments/fernandez/study.h"

namespace omnifleet::fernandez {

/// Shape differences of a run of all services. NaN: not measured.
struct RunFigures {
  double path = 0.0;        ///< of the trajectory
  double places = 0.0;      ///< of the topological map
  double distance_m = 0.0;  ///< mean error of the path
  int nodes = 0;            ///< of the topological map

  /// Reads the metrics.json of the first robot. Throws std::runtime_error.
  static RunFigures load(const std::string& run);
};

/// One set of images of one seed.
struct SetFigures {
  std::optional<StudyResult> study;
  std::map<std::string, RunFigures> runs;  ///< by folder: "literal", "no_wheels", "omnifleet"

  static SetFigures load(const std::string& folder);
};

struct SeedFigures {
  std::uint32_t seed = 0;
  std::map<int, SetFigures> sets;  ///< 1 and 2

  static SeedFigures load(const std::string& out, std::uint32_t seed);
};

/// Rows of the table that grows while seeds finish, one per set.
std::string heading();
std::string rows(const SeedFigures& seed);

/// Table of all seeds, for each set: what the paper reports, then median and worst of the literal method, of
/// omnifleet without and with wheels, and of the wheels alone.
std::string report(const std::vector<SeedFigures>& seeds);

/// Value of a surface. NaN if it has no such terms or no such step.
double at(const StudyResult& study, const std::string& method, int step, int k1, int k2);
double least(const StudyResult& study, const std::string& method, int step);

}  // namespace omnifleet::fernandez
