#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formation/explorer.h"
#include "formation/fleet_view.h"
#include "formation/shared_grid.h"
#include "motion/avoidance.h"
#include "motion/boundary_law.h"
#include "motion/floor_memory.h"
#include "motion/formation_law.h"
#include "motion/formation_types.h"
#include "motion/leader_failover.h"
#include "motion/motion_guard.h"
#include "motion/narrowing.h"
#include "motion/near_field.h"
#include "motion/route.h"
#include "motion/trail.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::formation {

/// One robot's part of the formation (Choi et al. 2014 §IV.3, Fig. 12). The leader drives from waypoint to
/// waypoint and avoids obstacles. A follower keeps distance d and angle θ to the robot it follows, as seen by
/// its own camera; if that robot is not visible, its published pose is used. Beyond the paper, the leader
/// plans paths around obstacles that it remembers, followers move in where the passage is narrow, and a
/// silent leader is replaced. By command the robot follows the boundary of the free floor or explores with
/// the others instead (Ahmed et al. 2013 §3; behaviours.cpp). Called once per frame; uses no clock.
class Formation {
 public:
  struct Options {
    motion::FormationCommand command;  ///< behaviour, shape, distance_m, angle_rad, waypoints, boundary:
                                       ///< valid until the first command
    std::string leader;                ///< empty: the first robot by name
    motion::DriveLimits limits;
    motion::FollowLaw::Options follow;
    motion::LeadLaw::Options lead;
    motion::Avoidance::Options avoidance;
    motion::FloorMemory::Options memory;
    motion::Route::Options route;
    motion::Narrowing::Options narrowing;
    motion::LeaderFailover::Options leader_failover;
    motion::BoundaryLaw::Options boundary;
    motion::ExplorationGrid::Options grid;
    Explorer::Options exploration;
    motion::MotionGuard::Options guard;  ///< of boundary following and exploration
    double robot_margin_m = 0.05;        ///< m, likewise: clearance from the outlines of other robots
    double gate_m =
        0.35;  ///< m, a track within this distance of the expected place of the followed robot is that robot
    double own_points_m =
        0.10;  ///< m, scan points within this distance of the body of a published robot belong to it
    bool published_poses = true;  ///< false: other robots are known from the own camera only, as in the paper
    double pose_age_limit_s = 1.0;  ///< s, older published poses are not used
    double unseen_limit_s =
        2.0;  ///< s, a follower stops if the followed robot is neither visible nor published for this long

    static Options read(const options::Section& section);
  };

  struct Output {
    motion::WheelCommand command;
    motion::FormationState state;
  };

  /// `bodies`: all robots of the fleet, including this one. Throws std::runtime_error if this robot or the
  /// leader is not among them.
  Formation(const std::string& robot, const std::map<std::string, RobotBody>& bodies, const Options& options);

  /// A new command. Returns false and ignores it if it is for another fleet or not the latest.
  bool command(const motion::FormationCommand& command);

  /// Robots that stand at a known pose and publish nothing.
  void park(const std::map<std::string, Pose2>& map_from_bases);

  /// One frame: the objects that this robot sees, the latest published poses of all robots (usually of the
  /// frame before; including its own) and the states that the others have published since. An invalid frame
  /// stops the robot.
  Output process(const Objects& objects, const std::vector<PoseEstimate>& poses,
                 const std::vector<motion::FormationState>& states = {});

  const Options& options() const { return options_; }
  /// What the views of the fleet have shown so far.
  const motion::ExplorationGrid& grid() const { return shared_.grid(); }

 private:
  void applyMotion(const Objects& objects);
  void updateLeader(const std::vector<motion::FormationState>& states, TimeNs now_ns);
  void updateShared(const std::vector<PoseEstimate>& poses,
                    const std::vector<motion::FormationState>& states);
  void updateSurroundings(const Objects& objects);
  void updateMemory(const Objects& objects);
  void classifyRobots(TimeNs now_ns);
  const Track* sighted(const Objects& objects, const Eigen::Vector2d& expected_m) const;
  std::optional<motion::Followed> byPublishedPose(TimeNs now_ns) const;
  motion::Followed byItsMotion(const Track& track) const;
  std::optional<motion::Followed> followed(const Objects& objects, const motion::Slot& slot);
  void switchFollowed(const std::string& followed_name);
  double worstFollower(TimeNs now_ns) const;
  double remainingDistance(TimeNs now_ns) const;
  void lead(const Objects& objects, Output& output);
  std::optional<motion::Route::Leg> nextLeg(const Pose2& map_from_base);
  void follow(const Objects& objects, Output& output);
  std::optional<Eigen::Vector2d> detour(const Eigen::Vector2d& place_m, TimeNs now_ns);
  bool nearEnough(const Eigen::Vector2d& place_m) const;
  void drive(const Eigen::Vector2d& wanted_mps, double feed_radps, double max_turn_radps, Output& output,
             double way_m = std::numeric_limits<double>::infinity());
  void behave(const Objects& objects, Output& output);
  std::optional<Pose2> poseOf(const std::string& robot, TimeNs now_ns) const;
  void updateBarriers(const Objects& objects, const Pose2& map_from_base);
  void addScan(const Scan& scan);
  motion::Barriers::Solid reserved(const std::string& name, const Pose2& map_from_other,
                                   const Pose2& base_from_map) const;
  motion::Twist explore(const Pose2& map_from_base, TimeNs now_ns, Output& output);
  motion::Twist followBoundary(const motion::BoundaryLaw::Result& ground, Output& output);

  std::string robot_;
  std::map<std::string, RobotBody> bodies_;
  Options options_;
  motion::LeaderFailover leader_failover_;
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
  std::optional<motion::Followed> last_followed_;  ///< in base_link of the previous frame, until updated
  TimeNs last_followed_ns_ = 0;
  motion::Trail trail_;  ///< of the followed robot
  TimeNs frame_ns_ = 0;
  double dt_s_ = 0.0;
  double turned_rad_ = 0.0;
  std::optional<Pose2> propagated_pose_;  ///< map_from_base of the previous frame, propagated by odometry:
                                          ///< the memory is relative to it
  double stuck_s_ = 0.0;                  ///< s without a path to the waypoint
  motion::Twist commanded_;
  motion::BoundaryLaw boundary_;
  motion::MotionGuard guard_;
  SharedGrid shared_;
  Explorer explorer_;
  std::map<std::string, Pose2> parked_;
  motion::Barriers barriers_;  ///< base_link
  bool held_ = false;          ///< the guard stopped the robot in the frame before
  std::vector<Eigen::Vector2d> remembered_m_;
  std::optional<motion::FormationState> published_;  ///< of the frame before
};

}  // namespace omnifleet::formation
