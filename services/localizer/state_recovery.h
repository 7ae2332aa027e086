#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "observation/observation.h"
#include "occupancy/contribution.h"

namespace omnifleet::localizer {

/// State that a localizer needs when it is restarted during a run. The initial poses of the fleet are no
/// longer valid. The current poses come from the latest keyframe poses, which the replicas of the map keep
/// for late joiners, and from the motion since, of which the classifiers keep some seconds.
class StateRecovery {
 public:
  /// @param kept number of each robot's last frames that are kept for late joiners
  /// @param mapping robots whose frames are kept
  StateRecovery(std::vector<estimation::RobotSetup> robots, const estimation::EstimatorOptions& options,
                std::uint32_t kept, std::set<std::string> mapping);

  /// Receives a pose held by a replica. The latest of each robot is used; for one frame, that of the highest
  /// (term, revision).
  void receive(const occupancy::KeyframePose& pose);
  /// Receives the notice of a frame, before the frame is processed.
  void receive(const Objects& frame);
  /// Whether a pose of every robot is known from which its frames continue without a gap. A replica sends its
  /// poses oldest first. (A robot whose frames are not kept only needs a pose.)
  bool isComplete() const;
  /// The same for the robots of which a frame has arrived, at least one. The others may be out of reach.
  bool isCompleteForHeard() const;

  /// The fleet for an estimator that begins now: without initial poses, with the camera errors found before.
  std::vector<estimation::RobotSetup> setups() const;

  /// Of robots that may map in a frame of their own, those that still do or have no pose yet, and where they
  /// are there at their first frame that is not past.
  std::map<std::string, Pose2> ownFrames(const std::map<std::string, Pose2>& may) const;

  /// The latest pose of each robot.
  const std::map<std::string, occupancy::KeyframePose>& latest() const { return latest_; }

  /// Robots whose latest pose is in map. How their frames lie in map was reported before the restart.
  std::set<std::string> inMap() const;

  /// Whether a time is before the robot's latest keyframe: such data are not needed any more and have been
  /// published.
  bool isPast(const std::string& robot, TimeNs time) const;

  /// Pose of a robot at its first frame that is not past (map_from_base), as a measurement. It is the
  /// keyframe's pose; if the frame of the keyframe is not available any more, σ grows with the time between.
  /// Without a keyframe it is the initial pose, provided that the robot has so few frames that none has been
  /// dropped. Then this frame is the first that any service received; it need not have number 0, because the
  /// first frames precede the discovery of the camera. Returned once per robot; nothing if its pose is
  /// unknown.
  std::optional<Measurement> recoverPose(const Objects& frame);
  /// Robots that have frames but an unknown pose, since the last call.
  std::vector<std::string> takeUnknownRobots();

 private:
  bool continues(const std::string& robot) const;

  std::map<std::string, estimation::RobotSetup> robots_;
  estimation::EstimatorOptions options_;
  std::uint32_t kept_;
  std::set<std::string> mapping_;
  std::map<std::string, occupancy::KeyframePose> latest_;
  std::map<std::string, std::uint32_t> newest_;  ///< largest sequence number received of each robot
  std::map<std::string, TimeNs> oldest_ns_;      ///< earliest frame received of each robot
  std::set<std::string> recovered_;
  std::vector<std::string> unknown_;
};

}  // namespace omnifleet::localizer
