#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/experiments/fernandez/topology.h"

namespace omnifleet::fernandez {

inline constexpr int kSteps = 4;         ///< Figs. 8 and 9: every image, every second, …
inline constexpr int kFigureTerms = 64;  ///< k1 = k2 of Figs. 6 and 7

/// One row per k1, one column per k2, both in the order of sweptFrequencies().
using Surface = std::vector<std::vector<double>>;

/// What the study of one set found (§V).
struct StudyResult {
  int images = 0;
  double length_m = 0.0;
  std::vector<int> terms;  ///< k1 and k2 of the surfaces
  /// Shape difference by name of the method, one surface per step.
  std::map<std::string, std::vector<Surface>> shape;
  std::map<std::string, std::vector<Surface>> build_s;  ///< seconds, steps 1 and 2
  std::vector<double> odometry;                         ///< shape difference of the wheels alone, per step
  /// Positions with every image and k1 = k2 = 64, by method; "truth" and "odometry" too.
  std::map<std::string, std::vector<Eigen::Vector2d>> paths;

  nlohmann::json toJson() const;
  /// Throws std::runtime_error that names the file.
  static StudyResult load(const std::string& path);
};

/// @param timed false: build_s stays empty
StudyResult study(const ImageSet& set, bool timed);

}  // namespace omnifleet::fernandez
