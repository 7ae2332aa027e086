#include "global_merger/structure_objects.h"

#include <algorithm>
#include <cmath>

#include "geometry/polygon.h"

namespace omnifleet::global_merger {
namespace {

constexpr double kStep_m = 0.02;  // between the points at which a polyline is compared

/// Length of the polyline within a distance of the obstacles, as a share.
double shareAt(const structure::Polyline& line, const std::vector<dataset::MapObject>& obstacles) {
  int points = 0, at_obstacles = 0;
  const std::size_t pieces = line.points_m.size() - (line.closed ? 0 : 1);
  for (std::size_t i = 0; i < pieces; ++i) {
    const Eigen::Vector2d &a = line.points_m[i], &b = line.points_m[(i + 1) % line.points_m.size()];
    const int steps = std::max(1, static_cast<int>(std::ceil((b - a).norm() / kStep_m)));
    for (int k = 0; k < steps; ++k) {
      const Eigen::Vector2d at_m = a + (b - a) * ((k + 0.5) / steps);
      ++points;
      at_obstacles += std::any_of(obstacles.begin(), obstacles.end(), [&](const dataset::MapObject& o) {
        return o.distanceTo(at_m) < kBeside_m;
      });
    }
  }
  return points > 0 ? at_obstacles / static_cast<double>(points) : 1.0;
}

Eigen::Vector2d middleOf(const std::vector<Eigen::Vector2d>& points_m) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < points_m.size(); ++i) {
    const double piece = (points_m[i + 1] - points_m[i]).norm();
    sum += piece * 0.5 * (points_m[i] + points_m[i + 1]);
    length += piece;
  }
  return length > 0.0 ? Eigen::Vector2d(sum / length) : points_m.front();
}

}  // namespace

std::vector<dataset::MapObject> structureObjects(const std::vector<structure::Polyline>& lines,
                                                 const std::vector<dataset::MapObject>& obstacles,
                                                 const std::vector<Eigen::Vector2d>& standing_m,
                                                 const std::vector<std::string>& robots,
                                                 const StructureRules& rules) {
  constexpr double kMost = 0.5;
  std::vector<dataset::MapObject> objects;
  for (const structure::Polyline& line : lines) {
    if (line.points_m.size() < 2 || static_cast<int>(line.observations) < rules.min_views) continue;
    if (shareAt(line, obstacles) > kMost) continue;
    dataset::MapObject object;
    object.id = kFirstStructureId + objects.size();
    const bool is_obstacle =
        line.closed && std::any_of(standing_m.begin(), standing_m.end(), [&](const Eigen::Vector2d& at_m) {
          return contains(line.points_m, at_m);
        });
    object.kind = is_obstacle ? "obstacle" : "structure";
    object.outline_m = line.points_m;
    if (line.closed && !is_obstacle) object.outline_m.push_back(line.points_m.front());
    object.centroid_m = line.closed ? centroid(line.points_m) : middleOf(line.points_m);
    object.observations = static_cast<int>(line.observations);
    for (std::size_t i = 0; i < robots.size(); ++i)
      if ((line.observers >> (i % 64U) & 1U) != 0) object.observers.push_back(robots[i]);
    object.covariance_m2 =
        (line.sigma_m * line.sigma_m + rules.pose_sigma_m * rules.pose_sigma_m) * Eigen::Matrix2d::Identity();
    objects.push_back(std::move(object));
  }
  return objects;
}

}  // namespace omnifleet::global_merger
