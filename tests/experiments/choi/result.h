#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace omnifleet::choi {

constexpr double kDegrees = 180.0 / M_PI;  ///< per radian

/// One map against the truth. Errors are over pairs of things within 0.5 m of one another, whatever their
/// shapes: the house's own gate (15 cm, IoU 0.3) would leave the worst of a method out of its mean.
struct MapScore {
  int truths = 0, told = 0;     ///< obstacles there are; objects of the map
  int found = 0;                ///< by the house's gate
  int paired = 0;               ///< within 0.5 m
  double x_m = 0.0, y_m = 0.0;  ///< mean |error| of the centroids of the pairs
  double distances_m = 0.0;     ///< mean |error| of the distances between them (the paper's own measure)
  double iou = 0.0;             ///< mean over the pairs
};

/// Paths of all robots against a reference, unaligned; means over all frames.
struct PathScore {
  int poses = 0;
  double x_m = 0.0, y_m = 0.0, distance_m = 0.0, heading_rad = 0.0;
};

/// A map made of the views of some of the robots (§IV.4).
struct TeamScore {
  std::string method;
  int robots = 0;
  MapScore map;
};

/// What one seed gave. Keys of the maps: "literal", "ours", and those of the table (table.cpp).
struct SeedResult {
  std::uint32_t seed = 0;
  std::string settings;  ///< of the run: results of other settings are made anew
  std::map<std::string, MapScore> maps;
  std::vector<TeamScore> teams;
  std::map<std::string, PathScore> paths;          ///< against the exact truth
  std::map<std::string, PathScore> paths_ceiling;  ///< against the ceiling tracker, as in the paper
  std::map<std::string, double> robots_f1;         ///< robots told from obstacles

  /// Throws std::runtime_error where it cannot be read or is none.
  static SeedResult load(const std::string& path);
  /// Whole or not at all.
  void save(const std::string& path) const;
};

}  // namespace omnifleet::choi
