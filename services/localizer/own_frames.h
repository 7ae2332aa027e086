#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "estimation/map_alignment.h"
#include "observation/observation.h"

namespace omnifleet::localizer {

/// Robots that do not know where they started. Each is followed by an estimator of its own, in a frame that
/// begins at its first pose, until its map is matched with the common one. Nothing of it enters the common
/// estimator before.
class OwnFrames {
 public:
  /// @param robots of the whole fleet @param first those without an initial pose that have scans to match,
  /// and the first pose of each in its frame: zero, or where a localizer that has failed left it
  OwnFrames(const std::vector<estimation::RobotSetup>& robots, const std::map<std::string, Pose2>& first,
            const estimation::EstimatorOptions& options);

  bool has(const std::string& robot) const { return own_.count(robot) > 0; }
  bool empty() const { return own_.empty(); }

  /// The robot's frame. @return its pose in its own frame
  PoseEstimate process(TimeNs time, const Objects& frame);
  bool refineDue() const;
  /// Solves what is due, compares the maps and moves robots that match into the common estimator, which has
  /// been through refine().
  void refine(estimation::FleetEstimator& common, TimeNs time);
  /// A robot that the common estimator has located by itself leaves its own frame.
  void giveUp(const std::string& robot, estimation::FleetEstimator& common, TimeNs time);
  /// End of the run: revised poses of the frames still in the windows.
  std::vector<PoseEstimate> finish();

  /// As of FleetEstimator; of all robots in own frames.
  std::vector<PoseEstimate> takeRevised();
  std::vector<Message> takeFindings();
  std::vector<Place> takePlaces();
  /// What has changed since the last call.
  std::vector<Alignment> takeAlignments();
  const estimation::RobotStatus& status(const std::string& robot) const {
    return own_.at(robot).estimator.status(robot);
  }

 private:
  struct Own {
    estimation::FleetEstimator estimator;
    estimation::MapAlignment matcher;
    Alignment published;
    int frames = 0;
    double driven_m = 0.0;  ///< …
    Pose2 counted_from;     ///< … up to this pose
  };
  void publish(const std::string& robot, Alignment alignment);
  void inOwnFrame(const std::string& robot, std::vector<PoseEstimate>& poses) const;

  std::map<std::string, Own> own_;
  std::vector<Alignment> changed_;
  std::vector<PoseEstimate> revised_;
  std::vector<Message> findings_;
};

}  // namespace omnifleet::localizer
