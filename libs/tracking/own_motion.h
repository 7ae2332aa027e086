#pragma once

#include <deque>
#include <optional>

#include "observation/observation.h"

namespace omnifleet::tracking {

/// The robot's own path in a private frame `odom` (identity at the first frame), chained from the motions of
/// the local maps. Like every odometry it drifts: only differences over some seconds are used.
class OwnMotion {
 public:
  /// Appends the next frame's motion. Returns false if the motion since the previous frame is unknown (a
  /// gap): nothing may be compared across it. The first frame is no gap.
  bool advance(const Motion& motion, TimeNs acquired_ns);

  /// Adds the localized pose of the robot at `time_ns`. Poses that are not later than the last one are
  /// ignored.
  void locate(TimeNs time_ns, const Pose2& map_from_base);
  /// Drift of odom between `then_ns` and now, from the localized poses: maps a place in odom at `then_ns` to
  /// its place in odom now. Nothing where no localized poses are available.
  std::optional<Pose2> driftSince(TimeNs then_ns) const;

  TimeNs now() const { return now_ns_; }
  double step_s() const { return step_s_; }  ///< seconds since the previous frame
  const Pose2& odomFromBase() const { return odom_from_base_; }
  const Eigen::Matrix3d& stepCovariance() const {
    return step_covariance_;
  }                                              ///< of the last step, right perturbation
  double stepLength() const { return step_m_; }  ///< metres moved since the previous frame

  /// Motion over `dt_s` at the velocity of the last step. Nothing where the last step is unknown.
  std::optional<Pose2> extrapolate(double dt_s) const;

  /// Pose of base_link in odom at `time_ns`, interpolated. Nothing before the last gap, for times in the
  /// future, or more than 10 s ago.
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
