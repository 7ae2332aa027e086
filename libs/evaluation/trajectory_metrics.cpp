#include "evaluation/trajectory_metrics.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace omnifleet::evaluation {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Index of the pose nearest in time; of two equally near, the earlier. `poses` must not be empty.
std::size_t nearest(const std::vector<StampedPose3>& poses, TimeNs time_ns) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), time_ns,
                                      [](const StampedPose3& pose, TimeNs t) { return pose.time_ns < t; });
  if (after == poses.begin()) return 0;
  const auto before = std::prev(after);
  if (after == poses.end()) return poses.size() - 1;
  const bool earlier = time_ns - before->time_ns <= after->time_ns - time_ns;
  return static_cast<std::size_t>((earlier ? before : after) - poses.begin());
}

Eigen::Isometry3d transform(const StampedPose3& pose) {
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.linear() = pose.orientation.toRotationMatrix();
  t.translation() = pose.position_m;
  return t;
}

Eigen::Matrix3Xd positions(const std::vector<StampedPose3>& poses) {
  Eigen::Matrix3Xd p(3, static_cast<Eigen::Index>(poses.size()));
  for (std::size_t i = 0; i < poses.size(); ++i) p.col(static_cast<Eigen::Index>(i)) = poses[i].position_m;
  return p;
}

/// Rotation that aligns x with y best (both centred), and the trace of DS in Umeyama's eq. 42.
Eigen::Matrix3d bestRotation(const Eigen::Matrix3Xd& x, const Eigen::Matrix3Xd& y, bool planar,
                             double& trace) {
  const Eigen::Matrix3d covariance = y * x.transpose() / static_cast<double>(x.cols());
  if (planar) {
    const double c = covariance(0, 0) + covariance(1, 1), s = covariance(1, 0) - covariance(0, 1);
    trace = std::hypot(c, s);
    return Eigen::AngleAxisd(std::atan2(s, c), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) sign.z() = -1.0;
  trace = svd.singularValues().dot(sign);
  return Eigen::Matrix3d(svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose());
}

}  // namespace

Statistics Statistics::of(std::vector<double> values) {
  Statistics s;
  s.count = static_cast<int>(values.size());
  if (values.empty()) {
    s.rmse = s.mean = s.median = s.std = s.min = s.max = kNaN;
    return s;
  }
  const double n = static_cast<double>(values.size());
  double sum = 0.0, squares = 0.0, spread = 0.0;
  for (const double v : values) {
    sum += v;
    squares += v * v;
  }
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  for (const double v : values) spread += (v - s.mean) * (v - s.mean);
  s.std = std::sqrt(spread / n);
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  s.median = values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  s.min = values.front();
  s.max = values.back();
  return s;
}

PosePairs associate(const std::vector<StampedPose3>& truth, const std::vector<StampedPose3>& estimate,
                    TimeNs max_difference_ns) {
  const bool estimate_longer = estimate.size() > truth.size();
  const auto& shorter = estimate_longer ? truth : estimate;
  const auto& longer = estimate_longer ? estimate : truth;
  PosePairs pairs;
  if (shorter.empty()) return pairs;
  for (const StampedPose3& pose : shorter) {
    const StampedPose3& other = longer[nearest(longer, pose.time_ns)];
    if (std::abs(other.time_ns - pose.time_ns) > max_difference_ns) continue;
    pairs.truth.push_back(estimate_longer ? pose : other);
    pairs.estimate.push_back(estimate_longer ? other : pose);
  }
  return pairs;
}

Similarity align(const std::vector<StampedPose3>& from, const std::vector<StampedPose3>& to,
                 Alignment alignment, bool scale) {
  Similarity result;
  if (from.empty() || (alignment == Alignment::kNone && !scale)) return result;
  const bool planar = alignment == Alignment::kSe2;
  Eigen::Matrix3Xd x = positions(from), y = positions(to);
  if (planar) {
    x.row(2).setZero();
    y.row(2).setZero();
  }
  const Eigen::Vector3d mean_x = x.rowwise().mean(), mean_y = y.rowwise().mean();
  x.colwise() -= mean_x;
  y.colwise() -= mean_y;
  double trace = 0.0;
  const Eigen::Matrix3d rotation = bestRotation(x, y, planar, trace);
  const double variance = x.squaredNorm() / static_cast<double>(x.cols());
  if (scale && variance > 0.0) result.scale = trace / variance;
  if (alignment == Alignment::kNone) return result;  // like evo's --correct_scale without --align
  result.rotation = rotation;
  result.translation = mean_y - result.scale * (rotation * mean_x);
  return result;
}

Statistics absoluteTrajectoryError(const PosePairs& pairs, Alignment alignment, bool scale) {
  const Similarity s = align(pairs.estimate, pairs.truth, alignment, scale);
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < pairs.truth.size(); ++i) {
    const Eigen::Vector3d moved = s.scale * (s.rotation * pairs.estimate[i].position_m) + s.translation;
    errors_m.push_back((moved - pairs.truth[i].position_m).norm());
  }
  return Statistics::of(std::move(errors_m));
}

RelativeError relativePoseError(const PosePairs& pairs, int delta) {
  std::vector<double> translation_m, rotation_rad;
  const auto step = static_cast<std::size_t>(std::max(delta, 1));
  for (std::size_t i = 0; i + step < pairs.truth.size(); i += step) {
    const Eigen::Isometry3d q = transform(pairs.truth[i]).inverse() * transform(pairs.truth[i + step]);
    const Eigen::Isometry3d p = transform(pairs.estimate[i]).inverse() * transform(pairs.estimate[i + step]);
    const Eigen::Isometry3d error = q.inverse() * p;
    translation_m.push_back(error.translation().norm());
    rotation_rad.push_back(std::abs(Eigen::AngleAxisd(error.linear()).angle()));
  }
  return {Statistics::of(std::move(translation_m)), Statistics::of(std::move(rotation_rad))};
}

bool poseAt(const std::vector<StampedPose>& truth, TimeNs time_ns, TimeNs max_gap_ns, Pose2& pose) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), time_ns,
                                      [](const StampedPose& one, TimeNs t) { return one.time_ns < t; });
  if (after == truth.end()) return false;
  if (after->time_ns == time_ns) {
    pose = after->map_from_base;
    return true;
  }
  if (after == truth.begin()) return false;
  const StampedPose &a = *std::prev(after), &b = *after;
  if (b.time_ns - a.time_ns > max_gap_ns) return false;
  const double t = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
  const Pose2 &p = a.map_from_base, &q = b.map_from_base;
  pose = {p.x_m + t * (q.x_m - p.x_m), p.y_m + t * (q.y_m - p.y_m),
          wrapAngle(p.theta_rad + t * wrapAngle(q.theta_rad - p.theta_rad))};
  return true;
}

PathMetrics comparePaths(const std::vector<StampedPose>& truth, const std::vector<StampedPose>& estimate,
                         TimeNs max_gap_ns) {
  PathMetrics m;
  m.truths = static_cast<int>(truth.size());
  std::vector<double> x_m, y_m, distance_m, heading_rad;
  for (const StampedPose& one : estimate) {
    Pose2 true_pose;
    if (!poseAt(truth, one.time_ns, max_gap_ns, true_pose)) {
      ++m.outside;
      continue;
    }
    const Eigen::Vector2d d = one.map_from_base.translation() - true_pose.translation();
    x_m.push_back(std::abs(d.x()));
    y_m.push_back(std::abs(d.y()));
    distance_m.push_back(d.norm());
    heading_rad.push_back(std::abs(wrapAngle(one.map_from_base.theta_rad - true_pose.theta_rad)));
  }
  const Statistics distance = Statistics::of(std::move(distance_m));
  m.poses = distance.count;
  m.distance_m = distance.mean;
  m.rmse_m = distance.rmse;
  m.max_m = distance.max;
  m.x_m = Statistics::of(std::move(x_m)).mean;
  m.y_m = Statistics::of(std::move(y_m)).mean;
  m.heading_rad = Statistics::of(std::move(heading_rad)).mean;
  return m;
}

StampedPose3 lift(const StampedPose& pose) {
  const Pose2& p = pose.map_from_base;
  return {pose.time_ns,
          {p.x_m, p.y_m, 0.0},
          Eigen::Quaterniond(Eigen::AngleAxisd(p.theta_rad, Eigen::Vector3d::UnitZ()))};
}

std::vector<StampedPose3> lift(const std::vector<StampedPose>& poses) {
  std::vector<StampedPose3> result;
  result.reserve(poses.size());
  for (const StampedPose& pose : poses) result.push_back(lift(pose));
  return result;
}

}  // namespace omnifleet::evaluation
