#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/trajectory_files.h"
#include "localizer/estimator_stage.h"

namespace omnifleet::localizer::testing {

/// Input of the estimator at one time of a recording with cameras.
struct RecordedTime {
  std::vector<Objects> frames;
  std::vector<Measurement> measurements;  ///< from the ceiling cameras
};

/// A pose with its error.
struct ComparedPose {
  PoseEstimate pose;
  Pose2 error;        ///< estimate⁻¹ · truth
  double nees = 0.0;  ///< eᵀP⁻¹e
};

/// Comparison of a run of a recording with its truth.
struct RecordedRun {
  double mean_m = 0.0, worst_m = 0.0, worst_rad = 0.0;
  double nees = 0.0;          ///< mean of eᵀP⁻¹e over frames and robots; 3 if consistent
  double heading_nees = 0.0;  ///< of the heading alone; 1 if consistent
  int poses = 0, invalid = 0;
  std::vector<ComparedPose> compared;  ///< in order of time
  std::vector<estimation::LandmarkEstimate> landmarks;
  std::map<std::string, estimation::CameraError> cameras;
};

using Truth = std::map<std::string, std::vector<dataset::StampedPose>>;

/// Images → local map → objects → poses, chained as in the services, in one thread. `ceiling`: with the
/// ceiling cameras. The estimator's input frames are stored in `times` unless that is null.
RecordedRun runRecorded(const dataset::Dataset& data, const estimation::EstimatorOptions& options,
                        bool ceiling, const Truth& truth, std::vector<RecordedTime>* times = nullptr);

/// The estimator alone, over the stored frames of such a run.
RecordedRun runFrames(const dataset::Dataset& data, const std::vector<RecordedTime>& times,
                      const estimation::EstimatorOptions& options, const Truth& truth);

}  // namespace omnifleet::localizer::testing
