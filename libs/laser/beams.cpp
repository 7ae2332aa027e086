#include "laser/beams.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::laser {
namespace {

Echo echoOf(float range_m, const dataset::LaserSensor& sensor) {
  const bool reach_known = sensor.range_max_m > 0.0;
  const bool none =
      !std::isfinite(range_m) || range_m <= 0.0f || (reach_known && range_m > sensor.range_max_m);
  if (none) return reach_known ? Echo::kNone : Echo::kBlind;
  return range_m < sensor.range_min_m ? Echo::kBlind : Echo::kHit;
}

}  // namespace

void Beams::set(const dataset::LaserRow& row, const dataset::LaserSensor& sensor) {
  const std::size_t n = row.range_m.size();
  const double yaw = sensor.baseFromLaser().theta_rad;
  const bool clockwise = row.angle_increment_rad < 0.0;
  spacing_rad = std::abs(row.angle_increment_rad);
  // Beams beyond one full turn repeat the first ones and are dropped.
  const auto turn = static_cast<std::size_t>(std::floor(2.0 * M_PI / spacing_rad + 0.5));
  const std::size_t count = std::min(n, turn);
  closed = count == turn;
  beam.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = clockwise ? count - 1 - i : i;
    Beam& b = beam[i];
    b.bearing_rad = yaw + row.angle_min_rad + static_cast<double>(k) * row.angle_increment_rad;
    b.echo = echoOf(row.range_m[k], sensor);
    b.range_m = b.echo == Echo::kHit ? static_cast<double>(row.range_m[k]) : sensor.range_max_m;
    b.point_m = b.range_m * Eigen::Vector2d(std::cos(b.bearing_rad), std::sin(b.bearing_rad));
  }
}

}  // namespace omnifleet::laser
