#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "motion/wheeled_model.h"
#include "observation/observation.h"

namespace omnifleet::formation {

/// Where the robots of the fleet are now, by what they have published: poses are a frame old or older, so
/// each is carried on, the others' by their speed, the own one by the own motion since. Where others do not
/// count, only the own pose is learned.
class FleetView {
 public:
  FleetView(const std::string& robot, double pose_age_limit_s, bool others)
      : robot_(robot), pose_age_limit_s_(pose_age_limit_s), others_(others) {}

  /// The own motion between two frames.
  void moved(TimeNs from_ns, TimeNs to_ns, const Pose2& from_from_to);
  void learn(const std::vector<PoseEstimate>& poses);
  /// map_from_base of a robot now; nothing where its pose is too old.
  std::optional<Pose2> now(const std::string& robot, TimeNs now_ns) const;
  /// From its latest two poses; zero for robots that have published none.
  motion::Twist twist(const std::string& robot) const;
  /// What the localizer says of this robot's own tracks.
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
  std::deque<Moved> moved_;  ///< frame by frame, as far back as published poses may lie
};

/// A pose that a twist has carried on.
Pose2 advanced(const Pose2& pose, const motion::Twist& twist, double dt_s);
double seconds(TimeNs from_ns, TimeNs to_ns);

}  // namespace omnifleet::formation
