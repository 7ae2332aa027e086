#pragma once

#include <vector>

#include "observation/observation.h"
#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {

/// Where a body stands, in integers.
struct Standing {
  PointDmm position;
  std::int32_t theta_dmrad = 0;
  friend bool operator==(const Standing& a, const Standing& b) {
    return a.position == b.position && a.theta_dmrad == b.theta_dmrad;
  }
};

/// A robot's footprint grown by a margin, for asking in integers which points lie under it. Footprints count
/// as convex (their hull is taken).
class BodyMask {
 public:
  BodyMask(const RobotBody& body, double margin_m, double default_radius_m);

  /// Distance from the robot's origin beyond which nothing is covered.
  std::int64_t reachDmm() const { return reach_dmm_; }
  /// `point` in the robot's base_link.
  bool covers(const PointDmm& point) const;

 private:
  struct Edge {
    std::int64_t normal_x, normal_y, offset;  ///< outward; covered where normal · p ≤ offset
  };
  std::int64_t reach_dmm_ = 0;
  std::vector<Edge> edges_;  ///< empty: a disc of reach_dmm_
};

}  // namespace omnifleet::occupancy
