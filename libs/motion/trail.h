#pragma once

#include <Eigen/Core>
#include <deque>

#include "geometry/pose2.h"

namespace omnifleet::motion {

/// The way that a robot nearby has come, as the observer has seen it. Where one robot has passed there is
/// room for another. Places are kept in `map` once the observer knows where it stands there (carried along by
/// the wheels alone, a way of some seconds goes astray by some centimetres); until then in a frame of its own
/// that the wheels carry. All places that go in or come out are in the observer's base_link.
class Trail {
 public:
  /// The observer has moved on, by its wheels.
  void moved(const Pose2& previous_from_current) {
    frame_from_base_ = frame_from_base_ * previous_from_current;
  }
  /// Where the observer stands. The first time all places are carried over; from then on it is the observer
  /// that is corrected, not the way.
  void stands(const Pose2& map_from_base);
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
  Pose2 frame_from_base_;
  bool in_map_ = false;
};

}  // namespace omnifleet::motion
