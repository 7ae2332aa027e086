#include "dataset/laser.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::dataset {

std::string problemOf(const LaserRow& row, std::size_t beams) {
  constexpr double kTurnSlack = 1e-3;  // files state increments with few digits
  const std::size_t count = row.range_m.size();
  if (!std::isfinite(row.angle_min_rad) || !std::isfinite(row.angle_increment_rad) ||
      row.angle_increment_rad == 0.0) {
    return "angle_min and angle_increment must be finite numbers, the increment not 0";
  }
  if (count == 0 || count > kMostBeams)
    return fmt::format("{} beams; 1 to {} are allowed", count, kMostBeams);
  if (beams != 0 && count != beams) return fmt::format("{} ranges, but earlier scans have {}", count, beams);
  if (std::abs(row.angle_increment_rad) * static_cast<double>(count - 1) > 2.0 * M_PI * (1.0 + kTurnSlack))
    return fmt::format("{} beams at {} rad exceed one full turn", count, row.angle_increment_rad);
  const bool good = std::all_of(row.range_m.begin(), row.range_m.end(), [](float r) { return r >= 0.0f; });
  return good ? "" : "a range is negative or not a number";
}

LaserSensor LaserSensor::read(const options::Section& section, const LaserSensor& defaults) {
  LaserSensor s = defaults;
  section.read("position_m", s.position_m, {-10.0, 10.0});
  section.read("yaw_deg", s.yaw_deg, {-360.0, 360.0});
  section.read("range_min_m", s.range_min_m, {0.0, 10.0});
  section.read("range_max_m", s.range_max_m, {0.0, 1000.0});
  section.read("range_sigma_m", s.range_sigma_m, {1e-4, 1.0});
  section.finish();
  return s;
}

LaserSensor LaserSensor::load(const std::string& path) {
  return read(options::Section::load(path), {});
}

std::string LaserSensor::toYaml() const {
  return fmt::format(
      "position_m: [{}, {}, {}]\nyaw_deg: {}\nrange_min_m: {}\nrange_max_m: {}\nrange_sigma_m: {}\n",
      position_m.x(), position_m.y(), position_m.z(), yaw_deg, range_min_m, range_max_m, range_sigma_m);
}

}  // namespace omnifleet::dataset
