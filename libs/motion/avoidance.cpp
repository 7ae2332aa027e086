#include "motion/avoidance.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::motion {
namespace {

// Costs, expressed as heading deviation, of a heading without any free distance and of one that is free with
// the tight margin only.
constexpr double kBlockedCostRad = 2.0;
constexpr double kTightCostRad = 0.5;
constexpr double kCreepM = 0.01;
constexpr double kStandstillMps = 1e-3;
constexpr double kLeastLookAheadM = 0.4;  // m, a robot needs this distance to turn aside
constexpr double kUnseenRadiusM = 0.08;   // m, of a remembered obstacle that is not visible
constexpr int kUnseenPoints = 8;
constexpr double kKnownPlaceM = 0.15;  // m, remembered positions with a larger σ do not change the heading

Eigen::Vector2d direction(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Distance along the unit vector until it touches a disc about `centre`; `limit_m` if it does not. The
/// radius of the disc is `widest_m`, or less if the centre is already nearer, so that the robot may pass or
/// leave but not come closer. The radius is never below `least_m`.
double distanceToDisc(const Eigen::Vector2d& unit, const Eigen::Vector2d& centre, double least_m,
                      double widest_m, double limit_m) {
  const double reach_m = std::clamp(centre.norm() - kCreepM, least_m, widest_m);
  const double along_m = unit.dot(centre), aside_m = std::abs(cross(unit, centre));
  if (along_m <= 0.0 || aside_m >= reach_m) return limit_m;
  return std::clamp(along_m - std::sqrt(reach_m * reach_m - aside_m * aside_m), 0.0, limit_m);
}

}  // namespace

DriveLimits DriveLimits::read(const options::Section& section) {
  DriveLimits limits;
  section.read("cruise_mps", limits.cruise_mps, {0.01, 5.0});
  section.read("max_mps", limits.max_mps, {0.01, 5.0});
  section.read("max_turn_radps", limits.max_turn_radps, {0.05, 20.0});
  section.read("lead_turn_radps", limits.lead_turn_radps, {0.05, 20.0});
  section.read("turn_gain_per_s", limits.turn_gain_per_s, {0.05, 20.0});
  section.read("max_mps2", limits.max_mps2, {0.01, 50.0});
  section.read("max_turn_radps2", limits.max_turn_radps2, {0.05, 200.0});
  section.finish();
  if (limits.cruise_mps > limits.max_mps) section.fail("cruise_mps", "must not exceed max_mps");
  return limits;
}

Avoidance::Options Avoidance::Options::read(const options::Section& section) {
  Options options;
  section.read("margin_m", options.margin_m, {0.0, 2.0});
  section.read("tight_margin_m", options.tight_margin_m, {0.0, 2.0});
  section.read("least_margin_m", options.least_margin_m, {0.0, 2.0});
  section.read("look_ahead_m", options.look_ahead_m, {0.1, 10.0});
  section.read("braking_mps2", options.braking_mps2, {0.01, 50.0});
  section.read("predict_s", options.predict_s, {0.1, 20.0});
  section.read("headings", options.headings, {8, 720});
  section.read("stay_weight", options.stay_weight, {0.0, 10.0});
  section.finish();
  if (options.tight_margin_m > options.margin_m) section.fail("tight_margin_m", "must not exceed margin_m");
  if (options.least_margin_m > options.tight_margin_m) {
    section.fail("least_margin_m", "must not exceed tight_margin_m");
  }
  return options;
}

void surroundingsFrom(const Objects& objects, double own_radius_m, double robot_radius_m,
                      Surroundings& around) {
  around.points_m.clear();
  around.robots.clear();
  around.radius_m = own_radius_m;
  const Scan& scan = objects.scan;
  const double step_rad = scan.range_m.empty() ? 0.0 : 2.0 * M_PI / static_cast<double>(scan.range_m.size());
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    if (!isSolid(scan.label[i]) || !std::isfinite(scan.range_m[i])) continue;
    around.points_m.push_back(scan.origin_m + scan.range_m[i] * direction(step_rad * static_cast<double>(i)));
  }
  for (const Track& track : objects.tracks) {
    if (track.kind == ObjectKind::kRobot) {
      around.robots.push_back({track.position_m, track.velocity_mps, robot_radius_m});
    } else if (!track.visible && track.covariance.trace() < kKnownPlaceM * kKnownPlaceM) {
      // Of a track that is not visible only the position is known.
      around.points_m.push_back(track.position_m);
      for (int i = 0; i < kUnseenPoints; ++i) {
        around.points_m.push_back(track.position_m +
                                  kUnseenRadiusM * direction(2.0 * M_PI * i / kUnseenPoints));
      }
    }
  }
}

double Avoidance::freeDistance(const Surroundings& around, const Eigen::Vector2d& unit, double speed_mps,
                               double margin_m, double limit_m) const {
  double free_m = limit_m;
  const double least_m = around.radius_m + std::min(margin_m, options_.least_margin_m);
  const double widest_m = around.radius_m + margin_m;
  for (const Eigen::Vector2d& point : around.points_m)
    free_m = distanceToDisc(unit, point, least_m, widest_m, free_m);
  for (const Neighbour& robot : around.robots) {
    // In the frame of the other robot: it counts only if both meet within the prediction horizon.
    const Eigen::Vector2d closing_mps = speed_mps * unit - robot.velocity_mps;
    const double closing = closing_mps.norm();
    if (closing < kStandstillMps) continue;
    const double limit = closing * options_.predict_s;
    const double way_m = distanceToDisc(closing_mps / closing, robot.position_m, least_m + robot.radius_m,
                                        widest_m + robot.radius_m, limit);
    if (way_m < limit) free_m = std::min(free_m, way_m / closing * speed_mps);
  }
  return free_m;
}

double Avoidance::brakableSpeed(const Surroundings& around, double forward_mps, double before_mps,
                                double step_s) const {
  const double speed_mps = std::abs(forward_mps), braking_mps2 = options_.braking_mps2;
  if (speed_mps < kStandstillMps) return forward_mps;
  const Eigen::Vector2d unit(forward_mps > 0.0 ? 1.0 : -1.0, 0.0);
  const double limit_m = options_.look_ahead_m, reach_m = around.radius_m + options_.least_margin_m;
  double free_m = limit_m;
  for (const Eigen::Vector2d& point : around.points_m)
    free_m = distanceToDisc(unit, point, reach_m, reach_m, free_m);
  for (const Neighbour& robot : around.robots) {
    const double apart_m = reach_m + robot.radius_m,
                 way_m = distanceToDisc(unit, robot.position_m, apart_m, apart_m, limit_m);
    if (way_m >= limit_m) continue;
    const double leaves_mps = robot.velocity_mps.dot(unit);
    const double on_m =
        0.5 * leaves_mps * std::abs(leaves_mps) / braking_mps2 + std::min(0.0, leaves_mps) * step_s;
    free_m = std::clamp(way_m + on_m, 0.0, free_m);
  }
  free_m = std::max(0.0, free_m - std::max(0.0, unit.x() * before_mps) * step_s);
  // v · step + v² / (2 · braking) = free
  const double step_mps = braking_mps2 * step_s;
  return unit.x() *
         std::min(speed_mps, std::sqrt(step_mps * step_mps + 2.0 * braking_mps2 * free_m) - step_mps);
}

Avoidance::Result Avoidance::steer(const Surroundings& around, const Eigen::Vector2d& wanted_mps,
                                   double turned_rad, double way_m) {
  chosen_rad_ = wrapAngle(chosen_rad_ - turned_rad);
  const double speed_mps = wanted_mps.norm();
  Result result;
  if (speed_mps < kStandstillMps) {
    turning_ = false;
    return result;
  }
  const double wanted_rad = std::atan2(wanted_mps.y(), wanted_mps.x());
  const double look_ahead_m =
      std::clamp(way_m, std::min(kLeastLookAheadM, options_.look_ahead_m), options_.look_ahead_m);
  double least_cost = std::numeric_limits<double>::infinity(), best_rad = wanted_rad;
  for (int i = 0; i < options_.headings; ++i) {
    const double heading_rad = wanted_rad + wrapAngle(2.0 * M_PI * i / options_.headings);
    const Eigen::Vector2d unit = direction(heading_rad);
    const double free_m = freeDistance(around, unit, speed_mps, options_.tight_margin_m, look_ahead_m);
    const double wide_m = freeDistance(around, unit, speed_mps, options_.margin_m, look_ahead_m);
    double cost = std::abs(wrapAngle(heading_rad - wanted_rad));
    cost += kBlockedCostRad * (1.0 - free_m / look_ahead_m);
    cost += kTightCostRad * (1.0 - wide_m / look_ahead_m);
    if (turning_) cost += options_.stay_weight * std::abs(wrapAngle(heading_rad - chosen_rad_));
    if (cost >= least_cost) continue;
    least_cost = cost;
    best_rad = heading_rad;
    result.free_m = free_m;
  }
  result.turned = std::abs(wrapAngle(best_rad - wanted_rad)) > 1e-6;
  turning_ = result.turned;
  chosen_rad_ = wrapAngle(best_rad);
  const double brakable_mps = std::sqrt(2.0 * options_.braking_mps2 * result.free_m);
  result.velocity_mps = std::min(speed_mps, brakable_mps) * direction(best_rad);
  return result;
}

}  // namespace omnifleet::motion
