#pragma once

#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::motion {

/// Obstacles where the robot's own body hides the floor (Scan::blind_m), remembered from before they came so
/// near. The scan reports only the part of such an obstacle that extends beyond the edge of the visible
/// floor, which is too far by the breadth of the body. The points move with the robot's own motion. They are
/// deleted once they leave the hidden area, where the scan is more accurate. All in base_link, metres.
class NearField {
 public:
  /// Applies the robot's own motion since the last call.
  void moved(const Pose2& previous_from_current);
  /// Adds the scan of one frame. Robots (RayLabel::kRobot) are not obstacles.
  void see(const Scan& scan);
  /// Removes the points within a radius of a place that is occupied by a robot.
  void clear(const Eigen::Vector2d& place_m, double radius_m);
  /// Points of hidden obstacles.
  const std::vector<Eigen::Vector2d>& points_m() const { return hidden_m_; }

 private:
  bool isKnown(const Eigen::Vector2d& point_m) const;

  std::vector<Eigen::Vector2d> seen_m_;  ///< from the last scan, near enough to become hidden before the next
  std::vector<Eigen::Vector2d> hidden_m_;
};

}  // namespace omnifleet::motion
