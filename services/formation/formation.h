#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formation/fleet_view.h"
#include "motion/avoidance.h"
#include "motion/floor_memory.h"
#include "motion/formation_law.h"
#include "motion/formation_types.h"
#include "motion/narrowing.h"
#include "motion/near_field.h"
#include "motion/route.h"
#include "motion/succession.h"
#include "motion/trail.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::formation {

/// One robot's share of the formation (Choi et al. 2014 §IV.3, Fig. 12): the leader goes from waypoint to
/// waypoint and turns for obstacles, a follower keeps distance d and angle θ to the robot it follows, which
/// it sees in its own camera; where sight is lost, the published pose stands in. Beyond the paper: the leader
/// finds its way round what it remembers to have seen, followers draw in where the passage is narrow, and a
/// lost leader is succeeded. Once per frame; no clock.
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
    motion::FloorMemory::Options memory;
    motion::Route::Options route;
    motion::Narrowing::Options narrowing;
    motion::Succession::Options succession;
    double gate_m = 0.35;        ///< m, a track this near to where the followed robot should be is that robot
    double own_points_m = 0.10;  ///< m, scan points this near to the body of a published robot are that robot
    bool published_poses = true;    ///< false: others are known by the own camera alone, as in the paper
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

  /// New orders; those of another fleet, and any but the latest, are left alone (false).
  bool command(const motion::FormationCommand& command);

  /// One frame: what this robot sees, the latest published poses of all robots (usually of the frame before;
  /// the own one too), and what the others said of themselves since. An invalid frame holds the robot still.
  Output process(const Objects& objects, const std::vector<PoseEstimate>& poses,
                 const std::vector<motion::FormationState>& states = {});

  const Options& options() const { return options_; }

 private:
  void remember(const Objects& objects);
  void obey(const std::vector<motion::FormationState>& states, TimeNs now_ns);
  void lookAround(const Objects& objects);
  void memorise(const Objects& objects);
  void tellRobots(TimeNs now_ns);
  const Track* sighted(const Objects& objects, const Eigen::Vector2d& expected_m) const;
  std::optional<motion::Followed> byPublishedPose(TimeNs now_ns) const;
  motion::Followed byItsWay(const Track& track) const;
  std::optional<motion::Followed> followed(const Objects& objects, const motion::Slot& slot);
  void forgetOther(const std::string& followed_name);
  double worstFollower(TimeNs now_ns) const;
  double wayLeft(TimeNs now_ns) const;
  void lead(const Objects& objects, Output& output);
  std::optional<motion::Route::Leg> wayOn(const Pose2& map_from_base);
  void follow(const Objects& objects, Output& output);
  std::optional<Eigen::Vector2d> wayRound(const Eigen::Vector2d& place_m, TimeNs now_ns);
  bool nearEnough(const Eigen::Vector2d& place_m) const;
  void drive(const Eigen::Vector2d& wanted_mps, double feed_radps, double max_turn_radps, Output& output,
             double way_m = std::numeric_limits<double>::infinity());

  std::string robot_;
  std::map<std::string, RobotBody> bodies_;
  Options options_;
  motion::Succession succession_;
  std::size_t rank_ = 0;
  motion::FollowLaw follow_;
  motion::LeadLaw lead_;
  motion::Avoidance avoidance_;
  motion::Narrowing narrowing_;
  motion::NearField near_field_;
  motion::FloorMemory memory_;
  motion::Route route_;
  motion::Surroundings around_;
  FleetView fleet_;
  std::string followed_name_;
  std::optional<motion::Followed> last_followed_;  ///< in base_link of the frame before, until updated
  TimeNs last_followed_ns_ = 0;
  motion::Trail trail_;  ///< of the followed robot
  TimeNs frame_ns_ = 0;
  double dt_s_ = 0.0;
  double turned_rad_ = 0.0;
  std::optional<Pose2> stood_;  ///< map_from_base a frame ago, moved on since; what the memory was made by
  double stuck_s_ = 0.0;        ///< how long no way has led on
  motion::Twist commanded_;
};

}  // namespace omnifleet::formation
