#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "motion/avoidance.h"
#include "motion/formation_types.h"
#include "motion/wheeled_model.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Slot of a rank (rank 0 leads): the rank that it follows, at distance d and at angle θ to its own heading
/// (Choi et al. 2014 Fig. 12).
struct Slot {
  std::size_t followed = 0;  ///< rank of the followed robot
  double distance_m = 0.0;
  double angle_rad = 0.0;
};
/// Slot of a rank ≥ 1. column: behind the rank before; line: abreast, alternately left and right; wedge: on
/// the arms of a V, θ as commanded; triangle: rows of one, two, three …, equilateral with side d (θ is not
/// used).
Slot slotOf(FormationShape shape, std::size_t rank, double distance_m, double angle_rad);

/// Whether the slot is straight behind. Such a follower queues on the path of the robot ahead, whatever the
/// heading of that robot.
bool isQueue(const Slot& slot);

/// Place of each rank in the leader's base_link while all robots drive straight, metres.
std::vector<Eigen::Vector2d> placesOf(const FormationCommand& command, std::size_t robots);

/// The followed robot as known to the follower, in the follower's base_link.
struct Followed {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  Twist twist;        ///< of the followed robot
  bool seen = false;  ///< by the follower's own camera; otherwise from the published pose
  /// m, remaining path of the formation; infinite if unknown.
  double remaining_m = std::numeric_limits<double>::infinity();
};

/// A place to keep and its motion, in the follower's base_link.
struct Place {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  ///< of its path
};

/// Control law that keeps a slot. The place behind the followed robot moves as a point of that robot's body.
/// Its velocity is fed forward and the distance to it is closed (l–φ control, Desai, Ostrowski and Kumar
/// 2001, with a point instead of two angles).
class FollowLaw {
 public:
  struct Options {
    double gain_per_s = 0.9;        ///< 1/s, closing speed per metre of distance to the place
    double closing_max_mps = 0.25;  ///< m/s, upper bound of the closing speed
    double swing_max_mps =
        0.20;  ///< m/s, upper bound of the place's swing about the followed robot that is fed forward
    double patient_m = 0.50;  ///< m, below this distance to the place the robot waits or moves obliquely
                              ///< forward instead of turning around
    double near_m =
        0.04;  ///< m, distance to the place that is accepted while the place moves slower than `stands_mps`
    double stands_mps = 0.03;  ///< m/s, below this speed the place counts as standing

    static Options read(const options::Section& section);
  };
  struct Result {
    Eigen::Vector2d place_m;       ///< base_link
    Eigen::Vector2d velocity_mps;  ///< desired, base_link
    double distance_error_m, angle_error_rad;
  };

  explicit FollowLaw(const Options& options) : options_(options) {}
  /// Place of the slot as a point of the followed robot's body.
  Place place(const Slot& slot, const Followed& followed) const;
  /// Desired motion to keep that place, or another one (narrow passages) if given.
  Result wanted(const Slot& slot, const Followed& followed) const {
    return wanted(slot, followed, place(slot, followed));
  }
  Result wanted(const Slot& slot, const Followed& followed, const Place& place) const;

 private:
  Options options_;
};

/// Control law of the leader: drives from waypoint to waypoint, slower while followers are out of place, and
/// stops at the goal.
class LeadLaw {
 public:
  struct Options {
    double passed_m = 0.25;     ///< m, a waypoint within this distance is passed
    double arrived_m = 0.05;    ///< m, the goal within this distance is reached
    double slow_m = 0.5;        ///< m, distance to the goal below which the speed falls
    double wait_from_m = 0.15;  ///< m, largest follower error at which the leader still drives at full speed
    double wait_full_m = 0.60;  ///< m, follower error at which the leader drives at `wait_speed`
    double wait_speed = 0.25;   ///< 1, share of the speed that is left at `wait_full_m`

    static Options read(const options::Section& section);
  };

  explicit LeadLaw(const Options& options) : options_(options) {}
  void follow(std::vector<Eigen::Vector2d> waypoints_m);
  /// Desired velocity in base_link; zero once the goal is reached. `via_m` (map): intermediate target if the
  /// straight line to the waypoint is blocked.
  Eigen::Vector2d wanted(const Pose2& map_from_base, double worst_follower_m, double cruise_mps,
                         const std::optional<Eigen::Vector2d>& via_m = std::nullopt);
  /// Marks waypoints near `here_m` (map) as passed without driving. Every robot does so, because it may lead
  /// after a failover.
  void passed(const Eigen::Vector2d& here_m);
  /// Advances to a later waypoint that another robot reports; never goes back.
  void skipTo(std::size_t next) { next_ = std::clamp(next, next_, waypoints_m_.size()); }
  std::size_t next() const { return next_; }
  bool arrived() const { return next_ >= waypoints_m_.size(); }
  /// Whether the next waypoint is the last.
  bool isGoal() const { return next_ + 1 == waypoints_m_.size(); }
  std::optional<Eigen::Vector2d> waypoint() const;
  /// Length of the straight legs from a place (map) through the remaining waypoints to the goal, metres; zero
  /// once the goal is reached.
  double remainingDistance(const Eigen::Vector2d& here_m) const;

 private:
  Options options_;
  std::vector<Eigen::Vector2d> waypoints_m_;
  std::size_t next_ = 0;
};

/// Twist that realizes a desired velocity (base_link): it turns towards it and drives with the share that
/// lies ahead. Slow velocities to the rear are driven backwards. `feed_radps`: turn rate of the place that is
/// kept. The change from the twist commanded before is limited; zero is reached exactly.
Twist twistTowards(const Eigen::Vector2d& velocity_mps, double feed_radps, const Twist& before, double dt_s,
                   double max_turn_radps, const DriveLimits& limits);

}  // namespace omnifleet::motion
