#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "motion/wheeled_model.h"
#include "observation/observation.h"

namespace omnifleet::formation {

/// Current poses of the fleet's robots, from their published poses. Published poses are at least one frame
/// old, so each is propagated: those of other robots by their speed, the own pose by the own motion since. If
/// others are not used, only the own pose is kept.
class FleetView {
 public:
  FleetView(const std::string& robot, double pose_age_limit_s, bool others)
      : robot_(robot), pose_age_limit_s_(pose_age_limit_s), others_(others) {}

  /// The own motion between two frames.
  void moved(TimeNs from_ns, TimeNs to_ns, const Pose2& from_from_to);
  void learn(const std::vector<PoseEstimate>& poses);
  /// Current map_from_base of a robot; nothing if its pose is too old.
  std::optional<Pose2> now(const std::string& robot, TimeNs now_ns) const;
  /// Estimated from the poses of a robot; zero before its second pose.
  motion::Twist twist(const std::string& robot) const;
  /// Sightings among this robot's own tracks, as published by the localizer.
  const std::vector<Sighting>& ownSightings() const;

 private:
  struct Known {
    Pose2 map_from_base;
    TimeNs acquired_ns = 0;
    motion::Twist twist;
    std::vector<Sighting> sightings;
  };
  struct Moved {
    TimeNs from_ns, to_ns;
    Pose2 from_from_to;
  };

  std::string robot_;
  double pose_age_limit_s_;
  bool others_;
  std::map<std::string, Known> known_;
  std::deque<Moved> moved_;  ///< per frame, back to the age limit of published poses
};

/// The pose, propagated by a constant twist.
Pose2 advanced(const Pose2& pose, const motion::Twist& twist, double dt_s);
double seconds(TimeNs from_ns, TimeNs to_ns);

}  // namespace omnifleet::formation
