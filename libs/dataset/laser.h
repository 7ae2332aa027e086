#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::dataset {

/// One scan in the scanner's frame: beam i at angle_min + i·increment. A beam without echo is +inf (in a file
/// 0, negative, NaN and "inf" all mean that, as scanners' drivers do).
struct LaserRow {
  TimeNs time_ns = 0;
  double angle_min_rad = 0.0, angle_increment_rad = 0.0;
  std::vector<float> range_m;
};

/// Beams of one scan that all readers can take.
constexpr std::size_t kMostBeams = 4096;

/// Empty, or what is wrong with a scan: an increment of 0 or not finite, more than a turn, no beams or more
/// than kMostBeams, a NaN or negative range, another number of beams than `beams` (0: any).
std::string problemOf(const LaserRow& row, std::size_t beams);

/// <robot>/laser/sensor.yaml: a level scanner, its mounting and what its ranges are worth.
struct LaserSensor {
  Eigen::Vector3d position_m{0.0, 0.0, 0.1};  ///< in base_link
  double yaw_deg = 0.0;                       ///< of the scanner's zero direction in base_link
  double range_min_m = 0.0;                   ///< m, an echo nearer than this is the robot's own
  double range_max_m = 0.0;                   ///< m, beams without echo were free so far; 0: not known
  double range_sigma_m = 0.01;                ///< m, of one range

  static LaserSensor read(const options::Section& section, const LaserSensor& defaults);
  /// Throws options::Error.
  static LaserSensor load(const std::string& path);
  std::string toYaml() const;
  Pose2 baseFromLaser() const { return {position_m.x(), position_m.y(), wrapAngle(yaw_deg * M_PI / 180.0)}; }
};

}  // namespace omnifleet::dataset
