#include "evaluation/solid_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::evaluation {

double surfaceDistance(const Polygon& footprint_m, double height_m, const Eigen::Vector3d& point_m) {
  const Eigen::Vector2d p = point_m.head<2>();
  double side = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < footprint_m.size(); ++i) {
    const Eigen::Vector2d a = footprint_m[i], edge = footprint_m[(i + 1) % footprint_m.size()] - a;
    const double square = edge.squaredNorm();
    const double share = square > 0.0 ? std::clamp((p - a).dot(edge) / square, 0.0, 1.0) : 0.0;
    side = std::min(side, (p - a - share * edge).norm());
  }
  const double over = point_m.z() - height_m;
  if (contains(footprint_m, p)) return over > 0.0 ? over : -std::min(side, -over);
  return over > 0.0 ? std::hypot(side, over) : side;
}

SolidMetrics compareSolids(const std::vector<dataset::MapObject>& scene,
                           const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> outside;
  for (const Eigen::Vector3d& point : points) {
    double least = std::numeric_limits<double>::infinity();
    for (const dataset::MapObject& solid : scene) {
      if (solid.height_m > 0.0)
        least = std::min(least, std::max(0.0, surfaceDistance(solid.outline_m, solid.height_m, point)));
    }
    if (std::isfinite(least)) outside.push_back(least);
  }
  SolidMetrics metrics;
  metrics.points = static_cast<int>(outside.size());
  if (outside.empty()) {
    metrics.median_m = metrics.share90_m = metrics.max_m = std::numeric_limits<double>::quiet_NaN();
    return metrics;
  }
  std::sort(outside.begin(), outside.end());
  const auto at = [&](double share) {
    return outside[static_cast<std::size_t>(share * static_cast<double>(outside.size() - 1))];
  };
  metrics.median_m = at(0.5);
  metrics.share90_m = at(0.9);
  metrics.max_m = outside.back();
  return metrics;
}

}  // namespace omnifleet::evaluation
