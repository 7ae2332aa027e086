#include "tests/unit/laser/room.h"

#include <cmath>
#include <limits>
#include <random>

namespace omnifleet::test {

double Room::distance(double bearing_rad) const {
  const Eigen::Vector2d u(std::cos(bearing_rad), std::sin(bearing_rad)), side(-u.y(), u.x());
  double nearest = std::numeric_limits<double>::infinity();
  for (const Polygon& polygon : polygons) {
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector2d a = polygon[i], b = polygon[(i + 1) % polygon.size()];
      const double da = side.dot(a), db = side.dot(b);
      if ((da > 0.0) == (db > 0.0)) continue;
      const double range = u.dot(a + da / (da - db) * (b - a));
      if (range > 0.0 && range < nearest) nearest = range;
    }
  }
  for (const Disc& disc : discs) {
    const double across = side.dot(disc.centre_m), half = disc.radius_m * disc.radius_m - across * across;
    if (half <= 0.0) continue;
    const double range = u.dot(disc.centre_m) - std::sqrt(half);
    if (range > 0.0 && range < nearest) nearest = range;
  }
  return nearest;
}

dataset::LaserRow Room::scan(int beams, double sigma_m, std::uint32_t seed) const {
  std::mt19937 generator(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  dataset::LaserRow row;
  row.angle_min_rad = -M_PI;
  row.angle_increment_rad = 2.0 * M_PI / beams;
  for (int i = 0; i < beams; ++i) {
    const double range = distance(row.angle_min_rad + i * row.angle_increment_rad);
    row.range_m.push_back(static_cast<float>(range + sigma_m * noise(generator)));
  }
  return row;
}

Polygon box(const Eigen::Vector2d& centre_m, const Eigen::Vector2d& size_m, double angle_rad) {
  const Eigen::Vector2d x(std::cos(angle_rad), std::sin(angle_rad)), y(-x.y(), x.x());
  const Eigen::Vector2d a = 0.5 * size_m.x() * x, b = 0.5 * size_m.y() * y;
  return {centre_m + a + b, centre_m - a + b, centre_m - a - b, centre_m + a - b};
}

}  // namespace omnifleet::test
