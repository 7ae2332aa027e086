#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/trajectory_files.h"
#include "localizer/estimator_stage.h"

namespace omnifleet::localizer::testing {

/// A recording of wheels, ranges and bearings, processed by the estimator and its frames without a bus, as
/// the localizer does.
struct ObservedRun {
  std::map<std::string, std::vector<dataset::StampedPose>> trajectories;  ///< causal
  std::map<std::string, double> nees;                                     ///< mean of eᵀP⁻¹e, with truth
  std::map<std::string, std::vector<dataset::StampedCovariance>> covariances;  ///< of the trajectories
  std::map<std::string, Eigen::Vector3d> parts;  ///< mean of e²/P of each of along, across, heading
  std::vector<estimation::PointEstimate> points;
  std::map<std::string, estimation::WheelModel> wheels;
  std::map<std::string, estimation::DetectorModel> detectors;
  std::map<std::string, estimation::RobotStatus> status;
};

struct ObservedRunOptions {
  estimation::EstimatorOptions estimator;
  bool survey = false;   ///< use recording.landmarks
  double until_s = 1e9;  ///< time of the recording from its first row
};

/// `truth` may be empty.
ObservedRun runObserved(const dataset::Dataset& recording, const ObservedRunOptions& options,
                        const std::map<std::string, std::vector<dataset::StampedPose>>& truth);

/// Rigid motion of the whole fleet onto the truth, because the frame is arbitrary if no landmark is surveyed.
/// @return truth_from_map
Pose2 alignToTruth(const ObservedRun& run,
                   const std::map<std::string, std::vector<dataset::StampedPose>>& truth);

}  // namespace omnifleet::localizer::testing
