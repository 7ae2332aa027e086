#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::localizer::testing {

/// A fleet with wheels and range-bearing detectors among named landmarks, in closed form with seeded noise.
/// It shares no formulas with the estimator.
struct ObservedFleetOptions {
  int robots = 3, landmarks = 12;
  double duration_s = 60.0, rate_hz = 4.0, wheel_rate_hz = 20.0;
  double sight_m = 4.0, half_view_rad = 0.5;  ///< range and half width of a detector's field of view
  double range_sigma_m = 0.04, range_sigma_per_m = 0.02, bearing_sigma_rad = 0.015;
  double wheel_sigma = 0.03;  ///< 1, σ of the constant error of each wheel
  double turn_sigma = 0.05;   ///< 1, σ of the constant error of the turn rate
  double turn_walk = 0.013,
         turn_walk_turning = 0.13;  ///< rad/√s and per rad/s: turn that the wheels do not measure
  double delay_s = 0.0;             ///< delay of the motion relative to the wheel log
  double obliqueness = 0.0;         ///< 1: the detector measures depth, not range
  double axis_rad = 0.0;            ///< direction of the detector's axis, along which that depth is measured
  double mounting_m = 0.0;          ///< distance of the detector in front of base_link
  double lag_s = 0.0;               ///< delay of the detector's timestamps
  double bearing_bias_rad = 0.0;
  double outliers = 0.0;  ///< share of observations with the name of a wrong landmark
  bool initial_poses = true;
  /// Robot r1 is kidnapped at this time: moved by 2 m and rotated by 2 rad, without any wheel motion.
  double kidnapped_s = -1.0;
};

struct ObservedFleet {
  dataset::Dataset recording;  ///< with surveyed landmarks
  std::map<std::string, std::vector<dataset::StampedPose>> truth;
  std::vector<dataset::MapObject> scene;  ///< the landmarks, named

  ObservedFleet(const ObservedFleetOptions& options, std::uint32_t seed);
  /// Writes a dataset to disk; `survey`: with landmarks.yaml.
  void write(const std::string& folder, bool survey) const;
};

}  // namespace omnifleet::localizer::testing
