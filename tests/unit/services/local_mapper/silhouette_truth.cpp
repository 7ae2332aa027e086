#include "tests/unit/services/local_mapper/silhouette_truth.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "outline/convex_hull.h"

namespace omnifleet::local_mapper::testing {

Polygon prismSilhouette(const Polygon& floor_m, double height_m, const Eigen::Vector2d& foot_m,
                        double camera_height_m) {
  Polygon points = floor_m;
  const double s = camera_height_m / (camera_height_m - height_m);
  for (const auto& p : floor_m) points.push_back(foot_m + s * (p - foot_m));
  return outline::convexHull(points);
}

Pose2 truePose(const dataset::GroundTruth& truth, const std::string& robot, TimeNs time_ns) {
  for (const auto& row : truth.trajectories.at(robot))
    if (std::abs(row.time_ns - time_ns) < 1000000) return row.map_from_base;  // TUM rounds the time
  throw std::runtime_error("no true pose of " + robot);
}

namespace {

TrueObject see(const std::string& name, const Polygon& in_map, double height_m, const Pose2& base_from_map,
               const lens::Camera& camera) {
  TrueObject object;
  object.name = name;
  object.height_m = height_m;
  for (const auto& p : in_map) object.floor_m.push_back(base_from_map * p);
  if (signedArea(object.floor_m) < 0) std::reverse(object.floor_m.begin(), object.floor_m.end());
  object.silhouette_m = prismSilhouette(object.floor_m, height_m, camera.foot(), camera.height());
  object.contact_m = 1e9;
  for (std::size_t i = 0; i < object.floor_m.size(); ++i) {
    const Eigen::Vector2d a = object.floor_m[i] - camera.foot();
    const Eigen::Vector2d edge = object.floor_m[(i + 1) % object.floor_m.size()] - camera.foot() - a;
    const double share = std::clamp(-a.dot(edge) / std::max(1e-12, edge.squaredNorm()), 0.0, 1.0);
    object.contact_m = std::min(object.contact_m, (a + share * edge).norm());
  }
  return object;
}

}  // namespace

std::vector<TrueObject> trueObjects(const dataset::Dataset& data, const dataset::GroundTruth& truth,
                                    const std::string& robot, TimeNs time_ns, const lens::Camera& camera) {
  const Pose2 base_from_map = truePose(truth, robot, time_ns).inverse();
  std::vector<TrueObject> objects;
  for (const auto& obstacle : truth.scene)
    objects.push_back(see("obstacle " + std::to_string(obstacle.id), obstacle.outline_m, obstacle.height_m,
                          base_from_map, camera));
  for (const auto& other : data.robots) {
    if (other.name == robot) continue;
    const Pose2 map_from_other = truePose(truth, other.name, time_ns);
    Polygon outline;
    for (const auto& p : other.body.outline()) outline.push_back(map_from_other * p);
    objects.push_back(see(other.name, outline, other.body.height_m, base_from_map, camera));
    objects.back().is_robot = true;
  }
  std::sort(objects.begin(), objects.end(),
            [](const auto& a, const auto& b) { return a.contact_m < b.contact_m; });
  return objects;
}

std::vector<int> match(const std::vector<TrueObject>& truth, const std::vector<ObjectObservation>& seen) {
  std::vector<int> matches;
  for (const auto& object : truth) {
    const Eigen::Vector2d middle = centroid(object.silhouette_m);
    int best = -1;
    double best_distance = 1e9;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (!contains(seen[i].hull_m, middle)) continue;
      const double distance = (centroid(seen[i].hull_m) - middle).norm();
      if (distance >= best_distance) continue;
      best_distance = distance;
      best = static_cast<int>(i);
    }
    matches.push_back(best);
  }
  return matches;
}

std::vector<SupportError> supportErrors(const TrueObject& truth, const ObjectObservation& seen,
                                        const lens::Camera& camera) {
  std::vector<SupportError> errors;
  const auto expected = SupportFunction::of(truth.silhouette_m, camera.foot(), 1.0);
  for (std::size_t k = 0; k < expected.size(); ++k) {
    if (!(seen.supports.sigma_m[k] > 0)) continue;
    const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(expected.size());
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const auto at = std::max_element(truth.silhouette_m.begin(), truth.silhouette_m.end(),
                                     [&](const auto& a, const auto& b) { return n.dot(a) < n.dot(b); });
    const auto pixel = camera.pixelFromPoint({at->x(), at->y(), 0.0});
    if (!pixel) continue;
    // Metres per pixel along n: Jacobian of the floor by differences.
    Eigen::Matrix2d j;
    bool whole = true;
    for (int axis = 0; axis < 2; ++axis) {
      const auto a = camera.floorFromPixel(*pixel - 0.5 * Eigen::Vector2d::Unit(axis));
      const auto b = camera.floorFromPixel(*pixel + 0.5 * Eigen::Vector2d::Unit(axis));
      whole = whole && a && b;
      if (whole) j.col(axis) = *b - *a;
    }
    if (!whole) continue;
    const double metres = static_cast<double>(seen.supports.b_m[k]) - static_cast<double>(expected.b_m[k]);
    errors.push_back({metres, metres / (j.transpose() * n).norm(), expected.b_m[k] >= 0.0f});
  }
  return errors;
}

}  // namespace omnifleet::local_mapper::testing
