#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "observation/observation.h"

namespace omnifleet::localizer {

/// The localizer's logic without a bus: frames and measurements in, one pose per frame out.
class EstimatorStage {
 public:
  EstimatorStage(std::vector<estimation::RobotSetup> robots, const estimation::EstimatorOptions& options);

  /// Processes all samples of one time. Returns exactly one PoseEstimate per frame, in the order given. It is
  /// invalid if the pose is not known yet, for robots that are not in the fleet, and for frames out of order.
  /// Measurements with non-finite numbers, without a positive definite covariance or of unknown robots are
  /// counted and ignored.
  std::vector<PoseEstimate> process(TimeNs time, const std::vector<const Objects*>& frames,
                                    const std::vector<const Measurement*>& measurements);

  /// See FleetEstimator::addWheels.
  void addWheels(const std::string& robot, TimeNs time, double left_mps, double right_mps) {
    estimator_.addWheels(robot, time, left_mps, right_mps);
  }

  /// See FleetEstimator: the work that can wait until the poses are published, and whether it is due.
  void refine() { estimator_.refine(); }
  bool refineDue() const { return estimator_.refineDue(); }

  /// End of the run: the last solve. Returns the revised poses of the frames still in the window.
  std::vector<PoseEstimate> finish() { return estimator_.finish(); }

  /// See FleetEstimator.
  std::vector<PoseEstimate> takeRevised() { return estimator_.takeRevised(); }
  std::vector<Message> takeFindings() { return estimator_.takeFindings(); }

  const estimation::FleetEstimator& estimator() const { return estimator_; }
  std::uint64_t rejectedMeasurements() const { return rejected_measurements_; }
  std::uint64_t rejectedFrames() const { return rejected_frames_; }
  /// Message for service/status about one robot; code kNone if there is no problem.
  Message status(const std::string& robot) const;

 private:
  bool usable(const Measurement& measurement) const;

  std::set<std::string> robots_;
  std::vector<const Objects*> known_;
  std::vector<const Measurement*> usable_;
  estimation::FleetEstimator estimator_;
  std::uint64_t rejected_measurements_ = 0, rejected_frames_ = 0;
};

}  // namespace omnifleet::localizer
