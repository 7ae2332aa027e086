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
/// ahead is clear the robot keeps the boundary beside it at a distance. Otherwise avoidance acts: it turns in
/// place away from the boundary until the ground ahead is clear. The paper's camera looks ahead; so the
/// boundary beside and behind is a remembered one. The distance is kept by heading along the normal vector's
/// perpendicular of the nearest boundary point, turned towards the boundary or away from it by the error of
/// the distance. So the robot rounds an outer corner in an arc.
class BoundaryLaw {
 public:
  struct Options {
    bool right = true;        ///< side on which the boundary is kept
    double clear_m = 0.25;    ///< m, floor ahead of the outline that must be clear
    double margin_m = 0.05;   ///< m, beside the outline
    double gain_per_m = 3.0;  ///< 1/m, tangent of the angle of approach per metre of distance error
    double reach_m = 0.80;    ///< m, a boundary point farther away is not followed

    static Options read(const options::Section& section);
  };
  struct Result {
    bool clear = false;    ///< the ground clearance signal
    bool follows = false;  ///< a boundary is near
    /// Heading to drive to while clear, base_link.
    double heading_rad = 0.0;
    double turn = 0.0;        ///< while not clear: +1 to the left, −1 to the right
    double distance_m = 0.0;  ///< base_link to the boundary
  };

  /// @param outline_m of the body, base_link
  BoundaryLaw(const Options& options, Polygon outline_m);

  /// @param boundary what is near, base_link @param distance_m to keep between base_link and the boundary
  Result follow(const Barriers& boundary, double distance_m) const;
  /// The ground clearance signal: nothing within the floor that the body crosses when it drives straight
  /// ahead by `clear_m`.
  bool isClear(const Barriers& boundary) const;

 private:
  std::optional<Eigen::Vector2d> nearest(const Barriers& boundary) const;

  Options options_;
  Polygon outline_m_;
  Polygon ahead_m_;  ///< the floor that must be clear, base_link
};

}  // namespace omnifleet::motion
