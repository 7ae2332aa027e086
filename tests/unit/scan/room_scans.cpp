#include "room_scans.h"

#include <cmath>

namespace omnifleet::scan::testing {
namespace {

Polygon box(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

Polygon turned(const Polygon& polygon, const Pose2& by) {
  Polygon result;
  for (const Eigen::Vector2d& p : polygon) result.push_back(by * p);
  return result;
}

}  // namespace

double Scene::range(const Eigen::Vector2d& from, const Eigen::Vector2d& along) const {
  double nearest = 0.0;
  for (const Polygon& outline : outlines) {
    for (std::size_t k = 0; k < outline.size(); ++k) {
      const Eigen::Vector2d a = outline[k] - from, side = outline[(k + 1) % outline.size()] - outline[k];
      const double det = along.x() * side.y() - along.y() * side.x();
      if (std::abs(det) < 1e-12) continue;
      const double range = (a.x() * side.y() - a.y() * side.x()) / det,
                   share = (a.x() * along.y() - a.y() * along.x()) / det;
      if (range > 0.0 && share >= 0.0 && share <= 1.0 && (nearest == 0.0 || range < nearest)) nearest = range;
    }
  }
  return nearest;
}

Boundary Scene::scan(const Pose2& pose, double sigma, std::mt19937& random, int beams) const {
  std::normal_distribution<double> noise(0.0, 1.0);
  Boundary boundary;
  for (int i = 0; i < beams; ++i) {
    const double bearing = pose.theta_rad + 2.0 * M_PI * i / beams;
    const double range_m = range(pose.translation(), {std::cos(bearing), std::sin(bearing)});
    boundary.inverse_m.push_back(range_m > 0.0 ? static_cast<float>(1.0 / range_m + sigma * noise(random))
                                               : 0.0f);
    boundary.sigma.push_back(range_m > 0.0 ? static_cast<float>(std::max(sigma, 1e-5)) : 0.0f);
  }
  return boundary;
}

Scene furnishedRoom() {
  return {{box(-2.5, -2.0, 2.5, 2.0), box(-2.5, 1.4, -1.3, 2.0), box(1.9, -1.5, 2.5, -0.3),
           turned(box(-0.3, -0.2, 0.3, 0.2), {0.9, 1.0, 0.5}),
           turned(box(-0.15, -0.15, 0.15, 0.15), {-1.0, -1.1, 0.2})}};
}

Scene corridor() {
  return {{box(-20.0, -0.8, 20.0, 0.8)}};
}

}  // namespace omnifleet::scan::testing
