#pragma once

#include <Eigen/Core>
#include <deque>

#include "geometry/pose2.h"

namespace omnifleet::motion {

/// Path of a nearby robot, as seen by the observer. Where one robot has passed there is room for another.
/// Places are stored in `map` once the observer is localized. Before that they are stored in a local frame
/// that wheel odometry propagates, where a path of several seconds drifts by several centimetres. All places
/// passed in or returned are in the observer's base_link.
class Trail {
 public:
  /// Applies the observer's motion from wheel odometry.
  void moved(const Pose2& previous_from_current) {
    frame_from_base_ = frame_from_base_ * previous_from_current;
  }
  /// Sets the pose of the observer. The first call transforms all stored places to `map`; later calls correct
  /// the observer only, not the path.
  void setPose(const Pose2& map_from_base);
  /// Adds the current position of the robot, base_link. Steps shorter than 2 cm are merged; the last 4 m are
  /// kept.
  void add(const Eigen::Vector2d& place_m);
  void clear() { places_m_.clear(); }

  struct Spot {
    Eigen::Vector2d place_m;
    Eigen::Vector2d ahead;  ///< unit vector along the path at that place
  };
  /// Spot `back_m` behind the robot, measured along the trail. Beyond its end it is extrapolated straight
  /// backwards, along `heading_rad` if no direction of the path is known.
  Spot at(double back_m, double heading_rad) const;
  double length_m() const;

 private:
  std::deque<Eigen::Vector2d> places_m_;  ///< newest first
  Pose2 frame_from_base_;
  bool in_map_ = false;
};

}  // namespace omnifleet::motion
