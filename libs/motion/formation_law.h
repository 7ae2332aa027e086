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

/// Whom the robot of a rank follows (rank 0 leads), and how: the followed robot stands at distance d and at
/// angle θ to the own heading (Choi et al. 2014 Fig. 12).
struct Slot {
  std::size_t followed = 0;  ///< rank
  double distance_m = 0.0;
  double angle_rad = 0.0;
};
/// Slot of rank ≥ 1. column: behind the rank before; line: abreast, alternately right and left; wedge: on the
/// arms of a V, θ as commanded; triangle: rows of one, two, three …, equilateral with side d (θ is not used).
Slot slotOf(FormationShape shape, std::size_t rank, double distance_m, double angle_rad);

/// Straight behind: a queue anyway, whatever its heading a column goes where the robot before has gone.
bool isQueue(const Slot& slot);

/// Place of each rank in the leader's base_link while all drive straight. Metres.
std::vector<Eigen::Vector2d> placesOf(const FormationCommand& command, std::size_t robots);

/// The robot that is followed, as the follower knows it, in the follower's base_link.
struct Followed {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  Twist twist;        ///< its own
  bool seen = false;  ///< in the follower's own camera; else from its published pose
  /// m, how far the formation still goes, where that is known.
  double way_left_m = std::numeric_limits<double>::infinity();
};

/// A place to keep and how it moves, in the follower's base_link.
struct Place {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  ///< of the way that it takes
};

/// Keeps a slot: the place behind the followed robot moves as a point of its body would; its velocity is fed
/// forward and the distance to it is closed (l–φ control, Desai, Ostrowski and Kumar 2001, by a point instead
/// of two angles).
class FollowLaw {
 public:
  struct Options {
    double gain_per_s = 0.9;        ///< 1/s, closing speed per metre of distance to the place
    double closing_max_mps = 0.25;  ///< m/s, no faster than that
    double swing_max_mps =
        0.20;                  ///< m/s, no more of the place's swing about the followed robot is fed forward
    double patient_m = 0.50;   ///< m, out of place by less: wait or sidle forward rather than turn about
    double near_m = 0.04;      ///< m, out of place by less is good enough …
    double stands_mps = 0.03;  ///< m/s, … while the place moves slower than this

    static Options read(const options::Section& section);
  };
  struct Result {
    Eigen::Vector2d place_m;       ///< base_link
    Eigen::Vector2d velocity_mps;  ///< wanted, base_link
    double distance_error_m, angle_error_rad;
  };

  explicit FollowLaw(const Options& options) : options_(options) {}
  /// The slot's place as a point of the followed robot's body.
  Place place(const Slot& slot, const Followed& followed) const;
  /// To keep that place, or another one (narrow passages) where given.
  Result wanted(const Slot& slot, const Followed& followed) const {
    return wanted(slot, followed, place(slot, followed));
  }
  Result wanted(const Slot& slot, const Followed& followed, const Place& place) const;

 private:
  Options options_;
};

/// The leader's way: waypoint after waypoint, slower while followers are out of place, still at the goal.
class LeadLaw {
 public:
  struct Options {
    double passed_m = 0.25;     ///< m, a waypoint this near is passed
    double arrived_m = 0.05;    ///< m, the goal this near is reached
    double slow_m = 0.5;        ///< m, the goal is approached with falling speed
    double wait_from_m = 0.15;  ///< m, followers out of place by this slow the leader …
    double wait_full_m = 0.60;  ///< m, … down to `wait_speed` when they are by this
    double wait_speed = 0.25;   ///< 1, share of the speed left

    static Options read(const options::Section& section);
  };

  explicit LeadLaw(const Options& options) : options_(options) {}
  void follow(std::vector<Eigen::Vector2d> waypoints_m);
  /// Wanted velocity in base_link; zero once the goal is reached. `via_m` (map): what to head for where the
  /// straight way to the waypoint is blocked.
  Eigen::Vector2d wanted(const Pose2& map_from_base, double worst_follower_m, double cruise_mps,
                         const std::optional<Eigen::Vector2d>& via_m = std::nullopt);
  /// Notes what has been passed without driving: every robot does, for it may have to lead one day.
  void passed(const Eigen::Vector2d& here_m);
  /// Others know of a later waypoint already.
  void skipTo(std::size_t next) { next_ = std::clamp(next, next_, waypoints_m_.size()); }
  std::size_t next() const { return next_; }
  bool arrived() const { return next_ >= waypoints_m_.size(); }
  /// The next waypoint is the last.
  bool isGoal() const { return next_ + 1 == waypoints_m_.size(); }
  std::optional<Eigen::Vector2d> waypoint() const;
  /// From a place (map) straight from waypoint to waypoint to the goal; zero once it is reached. Metres.
  double wayLeft(const Eigen::Vector2d& here_m) const;

 private:
  Options options_;
  std::vector<Eigen::Vector2d> waypoints_m_;
  std::size_t next_ = 0;
};

/// The twist that brings a wanted velocity (base_link) about: turns towards it and drives by the share that
/// lies ahead, backwards for slow wishes to the rear. `feed_radps` is the turning of the place that is kept.
/// Changes against the twist commanded before are limited; zero is reached exactly.
Twist twistTowards(const Eigen::Vector2d& velocity_mps, double feed_radps, const Twist& before, double dt_s,
                   double max_turn_radps, const DriveLimits& limits);

}  // namespace omnifleet::motion
