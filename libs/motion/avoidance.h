#pragma once

#include <limits>
#include <vector>

#include "motion/wheeled_model.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Drive limits of a robot.
struct DriveLimits {
  double cruise_mps = 0.25;     ///< m/s, desired speed of the leader
  double max_mps = 0.40;        ///< m/s, upper bound for every robot
  double max_turn_radps = 1.5;  ///< rad/s
  double lead_turn_radps =
      0.6;  ///< rad/s, upper bound for the leader, so that the outer followers can keep up
  double turn_gain_per_s = 1.4;  ///< 1/s, turn rate per radian of heading error
  double max_mps2 = 0.6;         ///< m/s², bound of the commanded acceleration
  double max_turn_radps2 = 4.0;  ///< rad/s², bound of the commanded angular acceleration

  static DriveLimits read(const options::Section& section);
};

/// Another robot nearby, in base_link.
struct Neighbour {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< over ground
  double radius_m = 0.15;
};

/// Obstacles and other robots around one robot at one frame, in its base_link.
struct Surroundings {
  std::vector<Eigen::Vector2d> points_m;  ///< contours of obstacles and of objects of unknown kind
  std::vector<Neighbour> robots;
  double radius_m = 0.15;  ///< of the robot's own body
};

/// Collects what must be avoided from one frame: rays that hit an obstacle or an object of unknown kind,
/// remembered obstacles that are not visible, and tracks of robots. Reuses the buffers of `around`.
void surroundingsFrom(const Objects& objects, double own_radius_m, double robot_radius_m,
                      Surroundings& around);

/// Turns a desired velocity into a collision-free one. The heading is the free one that deviates least from
/// the desired heading and from the heading chosen before (vector field histogram, Ulrich and Borenstein
/// 2000, on the points of the scan). The speed is then limited to what can still be braked (dynamic window,
/// Fox et al. 1997).
class Avoidance {
 public:
  struct Options {
    double margin_m = 0.22;  ///< m, clearance kept where there is room: a body hides the floor close to it
                             ///< from its own camera
    double tight_margin_m = 0.10;  ///< m, clearance kept in passages
    double least_margin_m =
        0.04;  ///< m, lower bound of the clearance, also if a body is already nearer than the margin
    double look_ahead_m = 1.0;  ///< m, obstacles beyond this distance do not change the heading
    double braking_mps2 = 0.5;  ///< m/s², the speed stays below √(2 · braking · free distance)
    double predict_s =
        1.5;  ///< s, prediction horizon: other robots are assumed to keep their velocity for this time
    int headings = 72;         ///< number of headings tried
    double stay_weight = 0.3;  ///< 1, cost per radian from the heading chosen before; a radian from the
                               ///< desired heading costs 1

    static Options read(const options::Section& section);
  };
  struct Result {
    Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< base_link; zero if no heading is free
    bool turned = false;  ///< the chosen heading differs from the desired one
    double free_m = 0.0;  ///< m, free distance along the chosen heading
  };

  explicit Avoidance(const Options& options) : options_(options) {}

  /// `turned_rad`: rotation of base_link since the last call; the remembered heading turns with it. `way_m`:
  /// distance that the robot intends to drive in that direction; obstacles beyond it do not change the
  /// heading.
  Result steer(const Surroundings& around, const Eigen::Vector2d& wanted_mps, double turned_rad,
               double way_m = std::numeric_limits<double>::infinity());

  /// Free distance along a unit vector at the given speed until the body, grown by the margin, touches an
  /// obstacle; at most `limit_m`. Another robot counts if both meet within `predict_s` at constant
  /// velocities.
  double freeDistance(const Surroundings& around, const Eigen::Vector2d& unit, double speed_mps,
                      double margin_m, double limit_m) const;

  /// Largest share of a forward speed (m/s; negative: backwards) that can still be braked before an obstacle
  /// is nearer than the least margin. The bound includes one step at the previously commanded speed, until
  /// this command takes effect, and one step at this speed. steer() alone is not sufficient: the robot does
  /// not yet head in the chosen direction, and robots ahead may brake as hard as it can (longitudinal rule of
  /// Shalev-Shwartz et al. 2017).
  double brakableSpeed(const Surroundings& around, double forward_mps, double before_mps,
                       double step_s) const;

  const Options& options() const { return options_; }

 private:
  Options options_;
  bool turning_ = false;
  double chosen_rad_ = 0.0;  ///< base_link
};

}  // namespace omnifleet::motion
