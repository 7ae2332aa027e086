#include "evaluation/classification.h"

#include <limits>

#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluation {
namespace {

constexpr TimeNs kMaxGap_ns = 1'000'000'000;

void count(bool is_true, bool is_reported, ClassCounts& counts) {
  if (is_true && is_reported) ++counts.right;
  if (is_true && !is_reported) ++counts.missed;
  if (!is_true && is_reported) ++counts.wrong;
}

double distance(const Eigen::Vector2d& point, const dataset::MapObject& object) {
  return contains(object.outline_m, point) ? 0.0 : (centroid(object.outline_m) - point).norm();
}

}  // namespace

double ClassCounts::f1() const {
  const int total = 2 * right + missed + wrong;
  return total > 0 ? 2.0 * right / total : std::numeric_limits<double>::quiet_NaN();
}

ClassCounts& ClassCounts::operator+=(const ClassCounts& other) {
  right += other.right;
  missed += other.missed;
  wrong += other.wrong;
  return *this;
}

KindMetrics& KindMetrics::operator+=(const KindMetrics& other) {
  robot += other.robot;
  obstacle += other.obstacle;
  phantoms += other.phantoms;
  return *this;
}

KindMetrics compareKinds(const std::string& observer, const std::vector<dataset::TrackRow>& tracks,
                         const std::map<std::string, std::vector<dataset::StampedPose>>& truth,
                         const std::vector<dataset::MapObject>& scene, double gate_m) {
  KindMetrics metrics;
  const auto own = truth.find(observer);
  if (own == truth.end()) return metrics;
  for (const dataset::TrackRow& row : tracks) {
    Pose2 map_from_base;
    if (!poseAt(own->second, row.time_ns, kMaxGap_ns, map_from_base)) continue;
    const Eigen::Vector2d place = map_from_base * row.position_m;
    double robot_m = std::numeric_limits<double>::infinity(), obstacle_m = robot_m;
    for (const auto& [name, poses] : truth) {
      Pose2 other;
      if (name == observer || !poseAt(poses, row.time_ns, kMaxGap_ns, other)) continue;
      robot_m = std::min(robot_m, (other.translation() - place).norm());
    }
    for (const dataset::MapObject& object : scene) obstacle_m = std::min(obstacle_m, distance(place, object));
    const bool is_robot = robot_m <= gate_m && robot_m <= obstacle_m;
    const bool is_obstacle = !is_robot && obstacle_m <= gate_m;
    metrics.phantoms += !is_robot && !is_obstacle;
    count(is_robot, row.kind == ObjectKind::kRobot, metrics.robot);
    count(is_obstacle, row.kind == ObjectKind::kObstacle, metrics.obstacle);
  }
  return metrics;
}

}  // namespace omnifleet::evaluation
