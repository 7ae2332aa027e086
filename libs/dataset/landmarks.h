#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace omnifleet::dataset {

/// A landmark whose place was surveyed: the ids of observations.csv that are not robots.
struct Landmark {
  std::string name;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< map
  double sigma_m = 0.005;                                ///< of the survey, each axis
};

/// landmarks.yaml: `landmarks: {NAME: {position_m: [x, y], sigma_m: s (optional)}, …}`. Sorted by name.
/// Throws options::Error.
std::vector<Landmark> readLandmarks(const std::string& path);
/// Throws std::runtime_error.
void writeLandmarks(const std::string& path, const std::vector<Landmark>& landmarks);

}  // namespace omnifleet::dataset
