#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "localizer/own_frames.h"
#include "observation/observation.h"

namespace omnifleet::localizer {

/// The localizer's logic without a bus: frames and measurements in, one pose per frame out.
class EstimatorStage {
 public:
  /// @param own_frames robots without an initial pose that map in a frame of their own until it is matched,
  /// and their first poses there
  EstimatorStage(std::vector<estimation::RobotSetup> robots, const estimation::EstimatorOptions& options,
                 const std::map<std::string, Pose2>& own_frames = {});

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
  void refine();
  bool refineDue() const { return estimator_.refineDue() || own_frames_.refineDue(); }

  /// End of the run: the last solve. Returns the revised poses of the frames still in the window.
  std::vector<PoseEstimate> finish();

  /// See FleetEstimator.
  std::vector<PoseEstimate> takeRevised();
  std::vector<Message> takeFindings();
  std::vector<Place> takePlaces();
  /// Robots whose alignment the localizer has reported before a restart: it still holds.
  void keepAlignments(const std::set<std::string>& robots);
  /// How the frames of the robots relate to map, where that has changed since the last call.
  std::vector<Alignment> takeAlignments();

  const estimation::FleetEstimator& estimator() const { return estimator_; }
  std::uint64_t rejectedMeasurements() const { return rejected_measurements_; }
  std::uint64_t rejectedFrames() const { return rejected_frames_; }
  /// Message for service/status about one robot; code kNone if there is no problem.
  Message status(const std::string& robot) const;

 private:
  bool usable(const Measurement& measurement) const;
  PoseEstimate inOwnFrame(TimeNs time, const Objects& frame, const PoseEstimate& common);
  void noteAnchored(const PoseEstimate& pose);

  std::set<std::string> robots_;
  std::vector<const Objects*> known_;
  std::vector<const Measurement*> usable_;
  estimation::FleetEstimator estimator_;
  OwnFrames own_frames_;
  TimeNs newest_ns_ = 0;
  std::map<std::string, std::string> anchors_;  ///< what defines the poses of robots that have none yet
  std::vector<Alignment> anchored_;             ///< since the last takeAlignments()
  std::uint64_t rejected_measurements_ = 0, rejected_frames_ = 0;
};

}  // namespace omnifleet::localizer
