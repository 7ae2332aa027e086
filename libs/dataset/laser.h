#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::dataset {

/// One scan in the frame of the scanner: beam i is at angle_min + i·increment. A beam without echo is +inf.
/// In a file 0, negative numbers, NaN and "inf" all mean no echo, as drivers of scanners write them.
struct LaserRow {
  TimeNs time_ns = 0;
  double angle_min_rad = 0.0, angle_increment_rad = 0.0;
  std::vector<float> range_m;
};

/// Maximum number of beams of a scan that all readers accept.
constexpr std::size_t kMostBeams = 4096;

/// Description of the problem of a scan, or empty: an increment of 0 or not finite, more than one full turn,
/// no beams or more than kMostBeams, a NaN or negative range, or a number of beams other than `beams` (0: any
/// number).
std::string problemOf(const LaserRow& row, std::size_t beams);

/// <robot>/laser/sensor.yaml: a level scanner with its mounting and its noise.
struct LaserSensor {
  Eigen::Vector3d position_m{0.0, 0.0, 0.1};  ///< in base_link
  double yaw_deg = 0.0;                       ///< direction of the scanner's zero angle in base_link
  double range_min_m = 0.0;                   ///< m; a nearer echo is the robot's own body
  double range_max_m = 0.0;                   ///< m; a beam without echo is free up to this range; 0: unknown
  double range_sigma_m = 0.01;                ///< m, σ of one range

  static LaserSensor read(const options::Section& section, const LaserSensor& defaults);
  /// Throws options::Error.
  static LaserSensor load(const std::string& path);
  std::string toYaml() const;
  Pose2 baseFromLaser() const { return {position_m.x(), position_m.y(), wrapAngle(yaw_deg * M_PI / 180.0)}; }
};

}  // namespace omnifleet::dataset
