#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace omnifleet::choi {

constexpr double kDegrees = 180.0 / M_PI;  ///< per radian

/// One map against the truth. Errors are means over pairs of centroids within 0.5 m, without a condition on
/// the shapes. The gate of `evaluate` (15 cm, IoU 0.3) would exclude the largest errors of a method from its
/// mean.
struct MapScore {
  int truths = 0, reported = 0;  ///< true obstacles; objects in the map
  int found = 0;                 ///< pairs within the gate of `evaluate`
  int paired = 0;                ///< pairs within 0.5 m
  double x_m = 0.0, y_m = 0.0;   ///< mean |error| of the centroids of the pairs
  double distances_m = 0.0;  ///< mean |error| of the distances between them (§V, the measure of the paper)
  double iou = 0.0;          ///< mean over the pairs
};

/// Paths of all robots against a reference, without alignment. Means over all frames; metres and radians.
struct PathScore {
  int poses = 0;
  double x_m = 0.0, y_m = 0.0, distance_m = 0.0, heading_rad = 0.0;
};

/// Score of a map from the views of some robots (§IV.4).
struct TeamScore {
  std::string method;
  int robots = 0;
  MapScore map;
};

/// Results of one seed. Keys: method ("literal", "omnifleet"), with prefix or suffix of the experiment
/// (table.cpp).
struct SeedResult {
  std::uint32_t seed = 0;
  std::string settings;  ///< of the run; a result with other settings is computed again
  std::map<std::string, MapScore> maps;
  std::vector<TeamScore> teams;
  std::map<std::string, PathScore> paths;          ///< against the exact truth
  std::map<std::string, PathScore> paths_ceiling;  ///< against the ceiling tracker, as in the paper
  std::map<std::string, double> robots_f1;         ///< F1 of robots against obstacles

  /// Throws std::runtime_error if the file cannot be read or is no result.
  static SeedResult load(const std::string& path);
  /// Writes the file atomically.
  void save(const std::string& path) const;
};

}  // namespace omnifleet::choi
