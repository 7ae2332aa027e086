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

/// What a localizer needs that takes another's place in the middle of a run. The starts of the fleet hold no
/// more; where the robots are is told by the latest keyframe poses, which the replicas of the map keep for
/// late joiners, and by the motion since, of which the classifiers keep some seconds.
class Succession {
 public:
  /// @param kept so many of each robot's last frames are kept for late joiners
  /// @param mapping the robots whose frames are
  Succession(std::vector<estimation::RobotSetup> robots, const estimation::EstimatorOptions& options,
             std::uint32_t kept, std::set<std::string> mapping);

  /// A pose that a replica has; of one robot the latest is taken, of one frame that of the highest (term,
  /// revision).
  void hear(const occupancy::KeyframePose& pose);
  /// That there is such a frame, before it is its turn.
  void hear(const Objects& frame);
  /// Of each robot a pose, from which its frames lead on without a gap: what a replica holds comes oldest
  /// first. (A robot whose frames nobody keeps needs a pose.)
  bool heardOfAll() const;

  /// The fleet as it is for an estimator that begins now: without starts, with the errors of the cameras that
  /// were found before.
  std::vector<estimation::RobotSetup> setups() const;

  /// What the robot did before its latest keyframe is of no use any more, and told already.
  bool isPast(const std::string& robot, TimeNs time) const;

  /// The pose of a robot at the first frame that is not past, map_from_base, to be measured with it: the
  /// keyframe's, less sure by the time between where that frame itself is not there any more; or its start
  /// where it has no keyframe and so few frames that none is kept no more: this is then the first that
  /// anybody had, which need not be number 0, as the first ones come before anybody has found the camera.
  /// Once per robot; nothing where nobody knows it.
  std::optional<Measurement> place(const Objects& frame);
  /// Robots that had frames since, and of which nobody knew where they are; since the last call.
  std::vector<std::string> takeUnknown();

 private:
  std::map<std::string, estimation::RobotSetup> robots_;
  estimation::EstimatorOptions options_;
  std::uint32_t kept_;
  std::set<std::string> mapping_;
  std::map<std::string, occupancy::KeyframePose> latest_;
  std::map<std::string, std::uint32_t> newest_;  ///< frame heard of each robot: its sequence number
  std::map<std::string, TimeNs> oldest_ns_;      ///< frame heard of each robot
  std::set<std::string> placed_;
  std::vector<std::string> unknown_;
};

}  // namespace omnifleet::localizer
