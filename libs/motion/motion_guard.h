#pragma once

#include <vector>

#include "geometry/polygon.h"
#include "motion/avoidance.h"
#include "motion/wheeled_model.h"
#include "options/options.h"

namespace omnifleet::motion {

/// What a body must not touch, in its base_link.
struct Barriers {
  /// An outline with the clearance that it needs.
  struct Solid {
    Polygon outline_m;
    double margin_m = 0.0;
  };
  std::vector<Eigen::Vector2d> points_m;
  std::vector<Solid> solids;
};

/// Limits a commanded twist so that the oriented outline of the body keeps its clearance to everything known,
/// also while it brakes to a stop afterwards (dynamic window, Fox et al. 1997, on the exact outline). The
/// command of the frame before is still executed for one frame. A command that passes this test leaves the
/// robot where it can stop, so that stopping always passes next. A body that is already too near may move if
/// it comes no nearer.
class MotionGuard {
 public:
  struct Options {
    double margin_m = 0.03;            ///< m, clearance of the outline
    double braking_mps2 = 0.5;         ///< m/s², deceleration that is counted on
    double turn_braking_radps2 = 4.0;  ///< rad/s²

    static Options read(const options::Section& section);
  };
  struct Result {
    Twist twist;
    Pose2 stop;            ///< where the body stands after braking, present base_link
    bool limited = false;  ///< `twist` differs from the wanted one
  };

  /// @param outline_m of the body, base_link
  MotionGuard(const Options& options, Polygon outline_m);

  /// @param before the twist commanded in the frame before
  /// @param dt_s frame period
  Result limit(const Twist& wanted, const Twist& before, double dt_s, const Barriers& barriers);

 private:
  void follow(const Twist& first, const Twist& second, double dt_s);
  double spareTo(std::size_t barrier, const Pose2& pose) const;
  bool passes(const Pose2& pose) const;

  Options options_;
  Polygon outline_m_;
  double reach_m_ = 0.0;
  std::vector<Pose2> path_;      ///< of the tested command, including braking
  std::size_t chosen_from_ = 0;  ///< first pose of `path_` that depends on the command
  Barriers near_;
  std::vector<double> least_m_;  ///< per barrier of `near_`: least spare clearance of an accepted pose
};

/// Distance between two simple polygons, metres; 0 if they overlap.
double distanceBetween(const Polygon& a, const Polygon& b);
/// Convex hull of the vertices of both, counter-clockwise.
Polygon hullOf(const Polygon& a, const Polygon& b);
/// Largest distance of a vertex from the origin, metres.
double reachOf(const Polygon& polygon);
/// The polygon at a pose.
Polygon placed(const Pose2& pose, const Polygon& polygon);

}  // namespace omnifleet::motion
