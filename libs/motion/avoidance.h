#pragma once

#include <limits>
#include <vector>

#include "motion/wheeled_model.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// What a robot may do.
struct DriveLimits {
  double cruise_mps = 0.25;     ///< m/s, the leader's wanted speed
  double max_mps = 0.40;        ///< m/s, nobody drives faster
  double max_turn_radps = 1.5;  ///< rad/s
  double lead_turn_radps =
      0.6;  ///< rad/s, the leader turns no faster, so that the outer followers can keep up
  double turn_gain_per_s = 1.4;  ///< 1/s, turning per radian off the wanted heading
  double max_mps2 = 0.6;         ///< m/s², change of the commanded speed
  double max_turn_radps2 = 4.0;  ///< rad/s²

  static DriveLimits read(const options::Section& section);
};

/// Another robot nearby, in base_link.
struct Neighbour {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< over ground
  double radius_m = 0.15;
};

/// What stands around one robot at one frame, in its base_link.
struct Surroundings {
  std::vector<Eigen::Vector2d> points_m;  ///< contours of obstacles and of unknown things
  std::vector<Neighbour> robots;
  double radius_m = 0.15;  ///< of the own body
};

/// Collects what must be avoided from one frame: rays that hit an obstacle or something unknown, tracks of
/// robots. Buffers of `around` are reused.
void surroundingsFrom(const Objects& objects, double own_radius_m, double robot_radius_m,
                      Surroundings& around);

/// Turns a wanted velocity into one that is free: of all headings the free one that strays least from the
/// wanted one and the one chosen before (a vector field histogram, Ulrich and Borenstein 2000, on the scan's
/// points), then a speed that can still be braked (dynamic window, Fox et al. 1997).
class Avoidance {
 public:
  struct Options {
    double margin_m = 0.22;  ///< m, kept where there is room: a body hides the floor close by from its camera
    double tight_margin_m = 0.10;  ///< m, kept in passages
    double least_margin_m = 0.04;  ///< m, kept even by a body that has come nearer already
    double look_ahead_m = 1.0;     ///< m, obstacles farther off do not turn the robot yet
    double braking_mps2 = 0.5;     ///< m/s², the speed stays below √(2 · braking · free distance)
    double predict_s = 1.5;        ///< s, other robots are where their velocity takes them within this time
    int headings = 72;             ///< headings tried
    double stay_weight =
        0.3;  ///< 1, cost of leaving the heading chosen before, per radian, against 1 for the wanted

    static Options read(const options::Section& section);
  };
  struct Result {
    Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< base_link; zero where nothing is free
    bool turned = false;                                     ///< not the wanted heading
    double free_m = 0.0;                                     ///< along the chosen heading
  };

  explicit Avoidance(const Options& options) : options_(options) {}

  /// `turned_rad`: how far base_link has turned since the last call (the memory of the heading turns with
  /// it). `way_m`: how far the robot means to go that way; what stands beyond turns nobody.
  Result steer(const Surroundings& around, const Eigen::Vector2d& wanted_mps, double turned_rad,
               double way_m = std::numeric_limits<double>::infinity());

  /// Free way along a unit vector at a speed before the body, grown by the margin, touches something; at most
  /// `limit_m`. Other robots count where they are met within `predict_s`, both moving on as they do.
  double freeWay(const Surroundings& around, const Eigen::Vector2d& unit, double speed_mps, double margin_m,
                 double limit_m) const;

  /// Of a speed straight on (m/s; negative: back) what can still be braked before anything is nearer than the
  /// least margin, after a step at the speed commanded before, until this one is obeyed, and a step at this
  /// one. A robot does not yet head where steer() wants it to, and those ahead may brake as hard as it can
  /// (the longitudinal rule of Shalev-Shwartz et al. 2017).
  double brakable(const Surroundings& around, double forward_mps, double before_mps, double step_s) const;

  const Options& options() const { return options_; }

 private:
  Options options_;
  bool turning_ = false;
  double chosen_rad_ = 0.0;  ///< base_link
};

}  // namespace omnifleet::motion
