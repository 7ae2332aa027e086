#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace omnifleet::dataset {

/// A landmark with a surveyed position: an id of observations.csv that is not a robot.
struct Landmark {
  std::string name;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< in map
  double sigma_m = 0.005;                                ///< σ of the survey, each axis
};

/// Reads landmarks.yaml: `landmarks: {NAME: {position_m: [x, y], sigma_m: s (optional)}, …}`. Sorted by name.
/// Throws options::Error.
std::vector<Landmark> readLandmarks(const std::string& path);
/// Throws std::runtime_error when the file cannot be written.
void writeLandmarks(const std::string& path, const std::vector<Landmark>& landmarks);

}  // namespace omnifleet::dataset
