#include "evaluate/summary.h"

#include <algorithm>
#include <limits>

namespace omnifleet::evaluate {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

Overall overall(const Report& report) {
  Overall sum;
  int shapes = 0;
  for (const RobotReport& r : report.robots) {
    sum.robots += r.path.poses > 0;
    if (!r.shape_difference) continue;
    sum.shape_difference += *r.shape_difference;
    ++shapes;
  }
  sum.shape_difference = shapes > 0 ? sum.shape_difference / shapes : kNone;
  if (sum.robots == 0) {
    sum.path.x_m = sum.path.y_m = sum.path.distance_m = sum.path.rmse_m = sum.path.heading_rad =
        sum.path.max_m = kNone;
    sum.ate_m = sum.rpe.translation_m.rmse = sum.rpe.rotation_rad.rmse = kNone;
    return sum;
  }
  const double n = sum.robots;
  for (const RobotReport& r : report.robots) {
    if (r.path.poses == 0) continue;
    sum.path.poses += r.path.poses;
    sum.path.x_m += r.path.x_m / n;
    sum.path.y_m += r.path.y_m / n;
    sum.path.distance_m += r.path.distance_m / n;
    sum.path.rmse_m += r.path.rmse_m / n;
    sum.path.heading_rad += r.path.heading_rad / n;
    sum.path.max_m = std::max(sum.path.max_m, r.path.max_m);
    sum.ate_m += r.ate_m.rmse / n;
    sum.rpe.translation_m.rmse += r.rpe.translation_m.rmse / n;
    sum.rpe.rotation_rad.rmse += r.rpe.rotation_rad.rmse / n;
  }
  return sum;
}

std::vector<std::pair<std::string, evaluation::Consistency>> consistencies(const Report& report) {
  std::vector<std::pair<std::string, evaluation::Consistency>> rows;
  for (const RobotReport& r : report.robots) {
    if (!r.consistency) continue;
    rows.emplace_back(r.name, *r.consistency);
  }
  if (report.consistency) rows.emplace_back("all", *report.consistency);
  return rows;
}

}  // namespace omnifleet::evaluate
