#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "motion/avoidance.h"
#include "motion/formation_law.h"
#include "motion/formation_types.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::formation {

/// One robot's share of the formation (Choi et al. 2014 §IV.3, Fig. 12): the leader goes from waypoint to
/// waypoint and turns for obstacles, a follower keeps distance d and angle θ to the robot it follows, which
/// it sees in its own camera; where sight is lost, the published pose stands in. Once per frame; no clock, no
/// memory of the map.
class Formation {
 public:
  struct Options {
    motion::FormationCommand
        command;         ///< shape, distance_m, angle_rad, waypoints: what to do until told otherwise
    std::string leader;  ///< empty: the first robot by name
    motion::DriveLimits limits;
    motion::FollowLaw::Options follow;
    motion::LeadLaw::Options lead;
    motion::Avoidance::Options avoidance;
    double gate_m = 0.35;        ///< m, a track this near to where the followed robot should be is that robot
    double own_points_m = 0.10;  ///< m, scan points this near to the body of a published robot are that robot
    double pose_age_limit_s = 1.0;  ///< s, older published poses are not used
    double lost_limit_s = 2.0;      ///< s, unseen and unpublished for so long: the follower stops

    static Options read(const options::Section& section);
  };

  struct Output {
    motion::WheelCommand command;
    motion::FormationState state;
  };

  /// `bodies`: every robot of the fleet, this one included. Throws std::runtime_error when this robot or the
  /// leader is not among them.
  Formation(const std::string& robot, const std::map<std::string, RobotBody>& bodies, const Options& options);

  /// New orders; those of another fleet or older ones are left alone (false).
  bool command(const motion::FormationCommand& command);

  /// One frame: what this robot sees and the latest published poses of all robots (usually of the frame
  /// before; the own one too). An invalid frame holds the robot still.
  Output process(const Objects& objects, const std::vector<PoseEstimate>& poses);

  const Options& options() const { return options_; }

 private:
  /// A robot as it was last published.
  struct Known {
    Pose2 map_from_base;
    TimeNs acquired_ns = 0;
    motion::Twist twist;  ///< from the latest two poses
    std::vector<Sighting> sightings;
  };
  struct Moved {
    TimeNs from_ns, to_ns;
    Pose2 from_from_to;
  };

  void learn(const std::vector<PoseEstimate>& poses);
  void remember(const Objects& objects);
  /// Where a robot is now by its published pose; nothing where that is too old.
  std::optional<Pose2> publishedNow(const std::string& robot, TimeNs now_ns) const;
  void lookAround(const Objects& objects);
  const Track* sighted(const Objects& objects, const Eigen::Vector2d& expected_m) const;
  std::optional<motion::Followed> followed(const Objects& objects);
  double worstFollower(TimeNs now_ns) const;
  void lead(const Objects& objects, Output& output);
  void follow(const Objects& objects, Output& output);
  bool nearEnough(const Eigen::Vector2d& place_m) const;
  void drive(const Eigen::Vector2d& wanted_mps, double feed_radps, double max_turn_radps, Output& output);

  std::string robot_, leader_;
  std::map<std::string, RobotBody> bodies_;
  std::vector<std::string> ranks_;  ///< leader first, then by name
  std::size_t rank_ = 0;
  Options options_;
  motion::FollowLaw follow_;
  motion::LeadLaw lead_;
  motion::Avoidance avoidance_;
  motion::Surroundings around_;
  std::map<std::string, Known> known_;
  std::deque<Moved> moved_;  ///< own motion, frame by frame, as far back as published poses may lie
  std::string followed_name_;
  std::optional<motion::Followed> last_followed_;  ///< in base_link of the frame before, until updated
  TimeNs last_followed_ns_ = 0;
  TimeNs frame_ns_ = 0;
  double dt_s_ = 0.0;
  double turned_rad_ = 0.0;
  motion::Twist commanded_;
};

}  // namespace omnifleet::formation
