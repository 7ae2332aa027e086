#include "geometry/polygon.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet {
namespace {
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}
}  // namespace

double signedArea(const Polygon& polygon) {
  if (polygon.size() < 3) return 0.0;
  double twice = 0.0;
  const Eigen::Vector2d origin = polygon.front();
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
    twice += cross(polygon[i] - origin, polygon[i + 1] - origin);
  return 0.5 * twice;
}

Eigen::Vector2d centroid(const Polygon& polygon) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  if (polygon.empty()) return mean;
  for (const auto& p : polygon) mean += p;
  mean /= static_cast<double>(polygon.size());
  double twice = 0.0;
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i] - mean, b = polygon[(i + 1) % polygon.size()] - mean;
    const double c = cross(a, b);
    twice += c;
    moment += c * (a + b);
  }
  if (std::abs(twice) < 1e-18) return mean;
  return mean + moment / (3.0 * twice);
}

bool contains(const Polygon& polygon, const Eigen::Vector2d& point) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[j];
    const Eigen::Vector2d edge = b - a, to = point - a;
    if (std::abs(cross(edge, to)) < 1e-15 && to.dot(edge) >= 0 && to.squaredNorm() <= edge.squaredNorm())
      return true;
    if ((a.y() > point.y()) != (b.y() > point.y()) &&
        point.x() < (b.x() - a.x()) * (point.y() - a.y()) / (b.y() - a.y()) + a.x()) {
      inside = !inside;
    }
  }
  return inside;
}

Polygon circlePolygon(const Eigen::Vector2d& centre, double radius_m, int vertices) {
  Polygon polygon;
  polygon.reserve(static_cast<std::size_t>(vertices));
  for (int i = 0; i < vertices; ++i) {
    const double a = 2.0 * M_PI * i / vertices;
    polygon.push_back(centre + radius_m * Eigen::Vector2d(std::cos(a), std::sin(a)));
  }
  return polygon;
}

double distanceTo(const Polygon& polygon, const Eigen::Vector2d& point) {
  if (contains(polygon, point)) return 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], along = polygon[(i + 1) % polygon.size()] - a;
    const double share = std::clamp((point - a).dot(along) / std::max(1e-12, along.squaredNorm()), 0.0, 1.0);
    nearest = std::min(nearest, (a + share * along - point).norm());
  }
  return nearest;
}

}  // namespace omnifleet
