#pragma once

#include <deque>
#include <optional>

#include "observation/observation.h"

namespace omnifleet::tracking {

/// The robot's own path in a private frame `odom` (identity at the first frame), chained from the motions
/// that the local maps carry. Drifts, as every odometry does; only differences over some seconds are used.
class OwnMotion {
 public:
  /// Takes in the next frame's motion. Returns false where the motion since the previous frame is not known
  /// (a gap): nothing may then be compared across it. The first frame is no gap.
  bool advance(const Motion& motion, TimeNs acquired_ns);

  /// Where the robot is known by now to have stood at that frame, in `map`. Times must not go back.
  void locate(TimeNs time_ns, const Pose2& map_from_base);
  /// What moves a place in odom of then to where odom would have it now, had the path since been as the
  /// located places tell: by how much odom has drifted. Nothing where they do not tell.
  std::optional<Pose2> driftSince(TimeNs then_ns) const;

  TimeNs now() const { return now_ns_; }
  double step_s() const { return step_s_; }  ///< seconds since the previous frame
  const Pose2& odomFromBase() const { return odom_from_base_; }
  const Eigen::Matrix3d& stepCovariance() const {
    return step_covariance_;
  }                                              ///< of the last step, right perturbation
  double stepLength() const { return step_m_; }  ///< metres moved since the previous frame

  /// The motion over `dt_s` of a robot that goes on as it went in its last step; nothing where that is not
  /// known.
  std::optional<Pose2> goingOn(double dt_s) const;

  /// Where base_link stood at `time_ns`, interpolated; nothing before the last gap, or older than ten
  /// seconds.
  std::optional<Pose2> odomFromBaseAt(TimeNs time_ns) const;

 private:
  struct Entry {
    TimeNs time_ns;
    Pose2 odom_from_base;
  };
  std::optional<Pose2> mapFromBaseAt(TimeNs time_ns) const;

  std::deque<Entry> path_;
  struct Place {
    TimeNs time_ns;
    Pose2 map_from_base;
  };
  std::deque<Place> places_;
  TimeNs now_ns_ = 0;
  double step_s_ = 0.0;
  double step_m_ = 0.0;
  Pose2 odom_from_base_;
  Eigen::Matrix3d step_covariance_ = Eigen::Matrix3d::Zero();
};

}  // namespace omnifleet::tracking
