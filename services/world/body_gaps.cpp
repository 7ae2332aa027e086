#include "world/body_gaps.h"

#include <algorithm>
#include <limits>

namespace omnifleet::world {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

/// Radius of the circle around base_link that contains the body.
double reach(const RobotBody& body) {
  double reach_m = body.radius_m;
  for (const Eigen::Vector2d& vertex : body.footprint_m) reach_m = std::max(reach_m, vertex.norm());
  return reach_m;
}

Polygon outlineAt(const RobotBody& body, const Pose2& map_from_base) {
  Polygon outline = body.outline();
  for (Eigen::Vector2d& vertex : outline) vertex = map_from_base * vertex;
  return outline;
}

/// Largest distance of `b` beyond an edge of `a`.
double beyondEdges(const Polygon& a, const Polygon& b) {
  double most = -kFar;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector2d edge = a[(i + 1) % a.size()] - a[i];
    const Eigen::Vector2d outward = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
    double least = kFar;
    for (const Eigen::Vector2d& corner : b) least = std::min(least, outward.dot(corner - a[i]));
    most = std::max(most, least);
  }
  return most;
}

}  // namespace

double gapBetween(const Polygon& a, const Polygon& b) {
  const double separation = std::max(beyondEdges(a, b), beyondEdges(b, a));
  if (separation <= 0.0) return separation;
  double gap = kFar;
  for (const Eigen::Vector2d& corner : a) gap = std::min(gap, distanceTo(b, corner));
  for (const Eigen::Vector2d& corner : b) gap = std::min(gap, distanceTo(a, corner));
  return gap;
}

double gapToSolid(const RobotBody& body, const Pose2& map_from_base, const synthetic::Solid& solid,
                  const Pose2& map_from_solid) {
  const double circle_m = solid.distance(map_from_base.translation(), map_from_solid) - reach(body);
  if (body.footprint_m.empty() || circle_m >= 0.0) return circle_m;
  return gapBetween(outlineAt(body, map_from_base), solid.footprintAt(map_from_solid));
}

double gapToBody(const RobotBody& a, const Pose2& map_from_a, const RobotBody& b, const Pose2& map_from_b) {
  const double circles_m = (map_from_a.translation() - map_from_b.translation()).norm() - reach(a) - reach(b);
  if ((a.footprint_m.empty() && b.footprint_m.empty()) || circles_m >= 0.0) return circles_m;
  return gapBetween(outlineAt(a, map_from_a), outlineAt(b, map_from_b));
}

}  // namespace omnifleet::world
