#pragma once

#include <Eigen/Core>
#include <deque>

#include "geometry/pose2.h"

namespace omnifleet::motion {

/// The way that a robot nearby has come, as the observer has seen it: places in the observer's base_link,
/// carried along with its own motion. Where one robot has passed there is room for another.
class Trail {
 public:
  /// The observer has moved on.
  void moved(const Pose2& previous_from_current);
  /// Where the robot is now, base_link. Steps shorter than 2 cm are joined; the last 4 m are kept.
  void add(const Eigen::Vector2d& place_m);
  void clear() { places_m_.clear(); }

  struct Spot {
    Eigen::Vector2d place_m;
    Eigen::Vector2d ahead;  ///< unit vector of the way there
  };
  /// The spot `back_m` behind the robot, measured along the trail; beyond its end straight on backwards,
  /// along `heading_rad` where nothing is known of the way.
  Spot at(double back_m, double heading_rad) const;
  double length_m() const;

 private:
  std::deque<Eigen::Vector2d> places_m_;  ///< newest first
};

}  // namespace omnifleet::motion
