#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "geometry/polygon.h"
#include "motion/motion_guard.h"
#include "motion/wheeled_model.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Boundary following with the ground clearance signal (Ahmed et al. 2013 §2.1 and §3). While the ground
/// ahead is clear the robot follows the boundary at a distance. Otherwise avoidance acts: it turns in place.
/// The paper's camera looks ahead; so the boundary beside and behind is a remembered one.
///
/// The heading is sought from the nearest boundary point on the followed side, turning away from it. The
/// first heading in which the body fits, for `look_m` ahead, leads along the boundary and into every opening.
/// From there on the clearance grows up to the commanded distance, or up to the middle of a passage that is
/// narrower; that heading is taken. So the robot rounds outer corners in an arc.
class BoundaryLaw {
 public:
  struct Options {
    bool right = true;       ///< side on which the boundary is kept
    double clear_m = 0.14;   ///< m, floor ahead of the outline that must be clear
    double margin_m = 0.05;  ///< m, beside the outline
    double look_m = 0.30;    ///< m, length of the path that is tested in each heading
    double reach_m = 1.0;    ///< m, a boundary point farther away is not followed

    static Options read(const options::Section& section);
  };
  struct Result {
    bool clear = false;    ///< the ground clearance signal
    bool follows = false;  ///< a boundary is near
    /// Heading to drive to while clear, base_link.
    double heading_rad = 0.0;
    double turn = 0.0;        ///< direction of turning while not clear: +1 to the left, −1 to the right
    double distance_m = 0.0;  ///< base_link to the boundary
  };

  /// @param outline_m of the body, base_link
  BoundaryLaw(const Options& options, Polygon outline_m);

  /// @param boundary what is near, base_link @param distance_m to keep between base_link and the boundary
  Result follow(const Barriers& boundary, double distance_m);
  /// The ground clearance signal: nothing within the floor that the body crosses when it drives straight
  /// ahead by `clear_m`.
  bool isClear(const Barriers& boundary) const;

 private:
  void collect(const Barriers& boundary);
  std::optional<Eigen::Vector2d> nearest() const;
  double clearance(double heading_rad) const;
  std::optional<double> headingAlong(double from_rad, double distance_m) const;

  Options options_;
  Polygon outline_m_;
  double turning_m_ = 0.0;                 ///< radius of the circle about base_link that holds the body
  std::vector<Eigen::Vector2d> points_m_;  ///< boundary points within reach
  Polygon ahead_m_;                        ///< the floor that must be clear, base_link
};

}  // namespace omnifleet::motion
