#pragma once

#include <vector>

#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

using dataset::StampedPose;
using dataset::StampedPose3;

/// rmse, mean, median, population standard deviation, min and max as `evo` prints them. NaN without values.
struct Statistics {
  int count = 0;
  double rmse = 0.0, mean = 0.0, median = 0.0, std = 0.0, min = 0.0, max = 0.0;
  static Statistics of(std::vector<double> values);
};

/// Poses of two trajectories, matched by time.
struct PosePairs {
  std::vector<StampedPose3> truth, estimate;  ///< equal lengths
};

/// Matches like evo: for each pose of the shorter trajectory the nearest in time of the longer one, if within
/// `max_difference_ns`. Both must be in increasing time.
PosePairs associate(const std::vector<StampedPose3>& truth, const std::vector<StampedPose3>& estimate,
                    TimeNs max_difference_ns = 10'000'000);

enum class Alignment { kNone, kSe2, kSe3 };

/// Least-squares similarity y ≈ s·R·x + t (Umeyama 1991, eq. 40–42). SE2: rotation about z and translation in
/// the plane only. s = 1 unless `scale` is set.
struct Similarity {
  double scale = 1.0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};
Similarity align(const std::vector<StampedPose3>& from, const std::vector<StampedPose3>& to,
                 Alignment alignment, bool scale);

/// ATE: the APE of evo, translation part, after alignment of the estimate. Metres.
Statistics absoluteTrajectoryError(const PosePairs& pairs, Alignment alignment, bool scale = false);

/// RPE as in evo, for consecutive pairs that are `delta` frames apart: (i, i + delta), (i + delta, i + 2
/// delta), …
struct RelativeError {
  Statistics translation_m, rotation_rad;
};
RelativeError relativePoseError(const PosePairs& pairs, int delta = 1);

/// Estimate against truth without alignment, at the times of the estimate. The truth is interpolated linearly
/// between neighbours at most `max_gap_ns` apart; at equal times it is used exactly. Errors in metres and
/// radians.
struct PathMetrics {
  int poses = 0;                                                     ///< estimates compared
  int outside = 0;                                                   ///< estimates at times without truth
  int truths = 0;                                                    ///< number of true poses
  double x_m = 0.0, y_m = 0.0, distance_m = 0.0, heading_rad = 0.0;  ///< means of |Δ|; NaN without poses
  double rmse_m = 0.0, max_m = 0.0;                                  ///< of the distance
};
PathMetrics comparePaths(const std::vector<StampedPose>& truth, const std::vector<StampedPose>& estimate,
                         TimeNs max_gap_ns = 1'000'000'000);

/// Truth at a time, interpolated as for PathMetrics. False if there is none.
bool poseAt(const std::vector<StampedPose>& truth, TimeNs time_ns, TimeNs max_gap_ns, Pose2& pose);

StampedPose3 lift(const StampedPose& pose);
std::vector<StampedPose3> lift(const std::vector<StampedPose>& poses);

}  // namespace omnifleet::evaluation
