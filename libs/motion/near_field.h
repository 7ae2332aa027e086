#pragma once

#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::motion {

/// What stands where the own body hides the floor (Scan::blind_m): things as they were seen before they came
/// so near. Of such a thing the scan tells only what stands out beyond the edge of the sight, a body's
/// breadth too far. Carried on by the own motion and forgotten once it comes out again, for there the scan
/// knows better. All in base_link, metres.
class NearField {
 public:
  /// The own motion since the last call.
  void moved(const Pose2& previous_from_current);
  /// One frame's scan; robots (RayLabel::kRobot) are no things.
  void see(const Scan& scan);
  /// Takes out what lies within a radius: a robot is there.
  void clear(const Eigen::Vector2d& place_m, double radius_m);
  /// Of hidden things.
  const std::vector<Eigen::Vector2d>& points_m() const { return hidden_m_; }

 private:
  bool isKnown(const Eigen::Vector2d& point_m) const;

  std::vector<Eigen::Vector2d> seen_m_;  ///< by the last scan, near enough to come in before the next
  std::vector<Eigen::Vector2d> hidden_m_;
};

}  // namespace omnifleet::motion
