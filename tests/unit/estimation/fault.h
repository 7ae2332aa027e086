#pragma once

#include <cstdint>

#include "fleet_simulator.h"

namespace omnifleet::estimation::testing {

/// Errors of r1's wheel polarity and assignment, for the whole run.
enum class WheelAssignment {
  kCorrect,
  kReversed,
  kSwapped,
  kReversedAndSwapped,
  kLeftReversed,
  kRightReversed
};

/// A fault of r1 (or of all robots) at one time of a simulated run.
struct Fault {
  SimulationOptions simulation;
  int at_frame = 25;    ///< first frame of the fault
  int dark_frames = 0;  ///< number of frames in which r1 observes nothing
  /// Kidnapping; in the middle of the dark frames if there are any.
  double kidnapped_m = 0.0, kidnapped_rad = 0.0;
  int spin_frames = 0;        ///< number of frames in which the left wheel spins
  double spin_m = 0.06;       ///< excess travel of the spinning wheel per frame
  double slip_m = 0.0;        ///< slip of both wheels in one frame, with 0.1 rad
  bool all_robots = false;    ///< slip, kidnapping and darkness affect all robots in the same way
  int gap_frames = 0;         ///< number of frames in which no robot sends observations
  bool wheels_in_gap = true;  ///< wheels count during the gap
  bool new_tracks = false;    ///< the tracker has lost all tracks after the dark or the gap
  WheelAssignment wheels = WheelAssignment::kCorrect;

  Fault() {
    simulation.frames = 70;
    simulation.initial_sigma_m = 0.005;
    simulation.initial_sigma_rad = 0.00524;
  }
};

struct FaultResult {
  int faulty = 0;             ///< robots with a fault
  int detected = 0;           ///< of these, robots with a report until 2 s after the fault
  int kidnapping_frames = 0;  ///< frames reported as kidnapped or as localization lost
  int false_reports = 0;  ///< frames with a report of a robot without a fault, before it or over 2 s after it
  int wheel_reports = 0;  ///< robots whose wheel assignment was reported as wrong
  double delay_s = 0.0;   ///< mean from the first observation to the report
  /// Errors of valid poses from the fault on, without the dark frames.
  double mean_m = 0.0, worst_m = 0.0;
  double end_m = 0.0;       ///< mean error of the last poses
  double nees = 0.0;        ///< of the poses of mean_m
  double valid = 0.0;       ///< share of frames with valid poses from the fault on
  int false_landmarks = 0;  ///< farther than 5 cm from every obstacle
};
FaultResult run(const Fault& fault, const EstimatorOptions& options, std::uint32_t seed);

}  // namespace omnifleet::estimation::testing
