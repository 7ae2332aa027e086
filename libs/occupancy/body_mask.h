#pragma once

#include <optional>
#include <vector>

#include "observation/observation.h"
#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {

/// Pose of a body, in integers.
struct IntegerPose {
  PointDmm position;
  std::int32_t theta_dmrad = 0;
  std::int32_t sigma_dmm = 0, sigma_dmrad = 0;
  friend bool operator==(const IntegerPose& a, const IntegerPose& b) {
    return a.position == b.position && a.theta_dmrad == b.theta_dmrad && a.sigma_dmm == b.sigma_dmm &&
           a.sigma_dmrad == b.sigma_dmrad;
  }
};

/// Footprint of a robot grown by a margin, with an integer test of which points lie under it. Footprints are
/// treated as convex (their hull is taken).
class BodyMask {
 public:
  BodyMask(const RobotBody& body, double margin_m, double default_radius_m);

  /// Distance from the robot's origin beyond which nothing is covered, without `more`.
  std::int64_t reachDmm() const { return reach_dmm_; }
  /// `point`: in the robot's base_link. `more`: added to the margin, 0.1 mm; negative: the footprint shrinks.
  bool covers(const PointDmm& point, std::int64_t more_dmm = 0) const;
  /// Distance along a ray at which it enters the footprint, in 0.1 mm, rounded down; 0 if it begins inside.
  /// `origin` and `along`: in the robot's base_link. `more`: added to the margin, 0.1 mm. Nothing if the ray
  /// misses it.
  std::optional<std::int64_t> entry(const PointDmm& origin, const Direction& along,
                                    std::int64_t more_dmm = 0) const;

 private:
  struct Edge {
    std::int64_t normal_x, normal_y, offset, length;  ///< outward; covered if normal · p ≤ offset
  };
  std::int64_t reach_dmm_ = 0;
  std::vector<Edge> edges_;  ///< empty: a disc of radius reach_dmm_
};

/// Calls visit(x, y) for each cell of side `resolution` (0.1 mm) whose centre lies under the body at a pose.
template <typename Visit>
void forEachCovered(const BodyMask& body, const IntegerPose& at, std::int64_t more_dmm,
                    std::int64_t resolution, const Visit& visit) {
  const std::int64_t reach = body.reachDmm() + more_dmm;
  if (reach < 0) return;
  const Direction d = directionOf(turnFromDmrad(at.theta_dmrad));
  const std::int64_t x_high = floorDivide(at.position.x_dmm + reach, resolution),
                     y_high = floorDivide(at.position.y_dmm + reach, resolution);
  for (std::int64_t y = floorDivide(at.position.y_dmm - reach, resolution); y <= y_high; ++y) {
    for (std::int64_t x = floorDivide(at.position.x_dmm - reach, resolution); x <= x_high; ++x) {
      const PointDmm centre{static_cast<std::int32_t>(x * resolution + resolution / 2 - at.position.x_dmm),
                            static_cast<std::int32_t>(y * resolution + resolution / 2 - at.position.y_dmm)};
      if (body.covers(unrotate(d, centre), more_dmm)) visit(x, y);
    }
  }
}

}  // namespace omnifleet::occupancy
