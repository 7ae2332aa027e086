#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::localizer::testing {

/// A fleet with wheels and range-bearing detectors among named landmarks, in closed form with seeded noise;
/// none of the estimator's own formulas.
struct ObservedFleetOptions {
  int robots = 3, landmarks = 12;
  double duration_s = 60.0, rate_hz = 4.0, wheel_rate_hz = 20.0;
  double sight_m = 4.0, half_view_rad = 0.5;  ///< as far and as wide as a detector sees
  double range_sigma_m = 0.04, range_sigma_per_m = 0.02, bearing_sigma_rad = 0.015;
  double wheel_sigma = 0.03;                           ///< 1, lasting error of each wheel
  double turn_sigma = 0.05;                            ///< 1, lasting error of the turn
  double turn_walk = 0.013, turn_walk_turning = 0.13;  ///< rad/√s and per rad/s: what the wheels do not tell
  double delay_s = 0.0;                                ///< by how much the motion lags the wheels' log
  double obliqueness = 0.0;                            ///< 1: the detector measures depth, not range
  double axis_rad = 0.0;       ///< where its axis points, to which that depth is measured
  double place_m = 0.0;        ///< how far in front of base_link it stands
  double lag_s = 0.0;          ///< by how much it tells later what it saw
  double bearing_bias_rad = 0.0;
  double outliers = 0.0;  ///< share of observations with a wrong landmark's name
  bool initial_poses = true;
  /// Robot r1 is carried away at this time, 2 m aside and turned by 2 rad, its wheels saying nothing of it.
  double kidnapped_s = -1.0;
};

struct ObservedFleet {
  dataset::Dataset recording;  ///< with landmarks (surveyed)
  std::map<std::string, std::vector<dataset::StampedPose>> truth;
  std::vector<dataset::MapObject> scene;  ///< the landmarks, named

  ObservedFleet(const ObservedFleetOptions& options, std::uint32_t seed);
  /// As a dataset on disk; `survey`: with landmarks.yaml.
  void write(const std::string& folder, bool survey) const;
};

}  // namespace omnifleet::localizer::testing
