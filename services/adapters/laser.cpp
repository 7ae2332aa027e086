#include "adapters/adapters.h"
#include "adapters/common.h"

namespace omnifleet::adapters {

void toWire(const dataset::LaserRow& from, const std::string& robot, std::uint32_t sequence,
            double range_max_m, RunClock clock, v1::LaserScan& to) {
  to.robot(robot);
  fillHeader(from.time_ns, sequence, clock, to.header());
  to.angle_min_rad(from.angle_min_rad);
  to.angle_increment_rad(from.angle_increment_rad);
  to.range_max_m(static_cast<float>(range_max_m));
  to.range_m(from.range_m);
}

bool fromWire(const v1::LaserScan& from, dataset::LaserRow& to) {
  to.time_ns = from.header().acquired_ns();
  to.angle_min_rad = from.angle_min_rad();
  to.angle_increment_rad = from.angle_increment_rad();
  to.range_m = from.range_m();
  if (std::isfinite(from.range_max_m()) && from.range_max_m() >= 0.0f && dataset::problemOf(to, 0).empty())
    return true;
  to.range_m.clear();
  return false;
}

}  // namespace omnifleet::adapters
