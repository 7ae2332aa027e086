#include "motion/boundary_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::motion {
namespace {

// The boundary is sought from behind (its remembered part, which an outer corner leaves there) to ahead.
constexpr double kBehind_rad = 2.7, kAhead_rad = 0.6;
constexpr double kSteepest_rad = M_PI / 3.0;  // away from a boundary that is too near
constexpr int kHeadings = 72;                 // tested in a full turn
constexpr double kTested = 0.4;     // share of the tested path that the robot has passed when it obeys
constexpr double kLessM = 0.01;     // a clearance lower by this much is past the middle of a passage
constexpr double kAimed_rad = 0.1;  // a smaller heading error does not decide the direction of turning
constexpr double kSampleM = 0.03;   // m, between points on the outline of a robot

}  // namespace

BoundaryLaw::Options BoundaryLaw::Options::read(const options::Section& section) {
  Options options;
  std::string side = "right";
  section.read("side", side, {"right", "left"});
  options.right = side == "right";
  section.read("clear_m", options.clear_m, {0.0, 5.0});
  section.read("margin_m", options.margin_m, {0.0, 2.0});
  section.read("look_m", options.look_m, {0.05, 5.0});
  section.read("reach_m", options.reach_m, {0.05, 10.0});
  section.finish();
  return options;
}

BoundaryLaw::BoundaryLaw(const Options& options, Polygon outline_m)
    : options_(options), outline_m_(std::move(outline_m)) {
  double front_m = 0.0, left_m = 0.0, right_m = 0.0;
  for (const Eigen::Vector2d& vertex : outline_m_) {
    front_m = std::max(front_m, vertex.x());
    left_m = std::max(left_m, vertex.y());
    right_m = std::min(right_m, vertex.y());
  }
  turning_m_ = reachOf(outline_m_);
  left_m += options.margin_m;
  right_m -= options.margin_m;
  const double end_m = front_m + options.clear_m;
  ahead_m_ = {{0.0, right_m}, {end_m, right_m}, {end_m, left_m}, {0.0, left_m}};
}

bool BoundaryLaw::isClear(const Barriers& boundary) const {
  // What touches the strip beside the body, behind its front, is not ahead.
  const auto blocks = [&](const Eigen::Vector2d& point_m) {
    return contains(ahead_m_, point_m) && distanceTo(outline_m_, point_m) > 0.0 &&
           point_m.x() > 0.5 * (ahead_m_[1].x() - options_.clear_m);
  };
  if (std::any_of(boundary.points_m.begin(), boundary.points_m.end(), blocks)) return false;
  return std::none_of(boundary.solids.begin(), boundary.solids.end(), [&](const Barriers::Solid& solid) {
    return distanceBetween(solid.outline_m, ahead_m_) <= 0.0;
  });
}

/// Boundary points within reach; of robots, points on their outlines.
void BoundaryLaw::collect(const Barriers& boundary) {
  points_m_.clear();
  const auto add = [&](const Eigen::Vector2d& point_m) {
    if (point_m.norm() <= options_.reach_m) points_m_.push_back(point_m);
  };
  for (const Eigen::Vector2d& point_m : boundary.points_m) add(point_m);
  for (const Barriers::Solid& solid : boundary.solids) {
    for (std::size_t i = 0; i < solid.outline_m.size(); ++i) {
      const Eigen::Vector2d& a = solid.outline_m[i];
      const Eigen::Vector2d way_m = solid.outline_m[(i + 1) % solid.outline_m.size()] - a;
      const int samples = 1 + static_cast<int>(way_m.norm() / kSampleM);
      for (int k = 0; k < samples; ++k) add(a + way_m * k / samples);
    }
  }
}

/// The nearest boundary point on the followed side.
std::optional<Eigen::Vector2d> BoundaryLaw::nearest() const {
  std::optional<Eigen::Vector2d> best;
  double least_m = options_.reach_m;
  const double side = options_.right ? -1.0 : 1.0;
  for (const Eigen::Vector2d& point_m : points_m_) {
    const double range_m = point_m.norm(), bearing_rad = side * std::atan2(point_m.y(), point_m.x());
    if (range_m >= least_m || bearing_rad > kBehind_rad || bearing_rad < -kAhead_rad) continue;
    least_m = range_m;
    best = point_m;
  }
  return best;
}

/// Least distance of the boundary from the far part of a straight path.
double BoundaryLaw::clearance(double heading_rad) const {
  const Eigen::Vector2d unit(std::cos(heading_rad), std::sin(heading_rad));
  double least_m = options_.reach_m;
  for (const Eigen::Vector2d& point_m : points_m_) {
    const double along_m = std::clamp(point_m.dot(unit), kTested * options_.look_m, options_.look_m);
    least_m = std::min(least_m, (point_m - along_m * unit).norm());
  }
  return least_m;
}

/// From a heading on, turning away from the boundary: the first heading in which the body fits, then on to
/// the commanded distance or to the middle of the passage.
std::optional<double> BoundaryLaw::headingAlong(double from_rad, double distance_m) const {
  const double step_rad = (options_.right ? 1.0 : -1.0) * 2.0 * M_PI / kHeadings;
  const double fits_m = turning_m_ + options_.margin_m;
  double most_m = 0.0, best_rad = from_rad;
  for (int i = 0; i < kHeadings; ++i) {
    const double heading_rad = from_rad + i * step_rad, clear_m = clearance(heading_rad);
    if (most_m <= 0.0 && clear_m < fits_m) continue;
    const bool steep = std::abs(i * step_rad) > M_PI_2 + kSteepest_rad;
    if (most_m > 0.0 && (steep || clear_m < most_m - kLessM)) break;
    if (clear_m > most_m) {
      most_m = clear_m;
      best_rad = heading_rad;
    }
    if (clear_m >= distance_m) break;
  }
  return most_m > 0.0 ? std::optional<double>(wrapAngle(best_rad)) : std::nullopt;
}

BoundaryLaw::Result BoundaryLaw::follow(const Barriers& boundary, double distance_m) {
  Result result;
  result.clear = isClear(boundary);
  result.turn = options_.right ? 1.0 : -1.0;
  collect(boundary);
  const auto point_m = nearest();
  if (!point_m) return result;
  result.follows = true;
  result.distance_m = point_m->norm();
  const auto heading_rad = headingAlong(std::atan2(point_m->y(), point_m->x()), distance_m);
  if (!heading_rad) return result;
  result.heading_rad = *heading_rad;
  if (std::abs(*heading_rad) > kAimed_rad) result.turn = *heading_rad > 0.0 ? 1.0 : -1.0;
  return result;
}

}  // namespace omnifleet::motion
