#include "motion/boundary_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::motion {
namespace {

// The boundary is sought from behind (its remembered part, which an outer corner leaves there) to ahead.
constexpr double kBehind_rad = 2.7, kAhead_rad = 0.6;
constexpr double kSteepest_rad = 1.0;  // of approach
constexpr double kSampleM = 0.03;      // m, between points on the outline of a robot

}  // namespace

BoundaryLaw::Options BoundaryLaw::Options::read(const options::Section& section) {
  Options options;
  std::string side = "right";
  section.read("side", side, {"right", "left"});
  options.right = side == "right";
  section.read("clear_m", options.clear_m, {0.0, 5.0});
  section.read("margin_m", options.margin_m, {0.0, 2.0});
  section.read("gain_per_m", options.gain_per_m, {0.0, 100.0});
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

/// The nearest boundary point on the followed side.
std::optional<Eigen::Vector2d> BoundaryLaw::nearest(const Barriers& boundary) const {
  std::optional<Eigen::Vector2d> best;
  double least_m = options_.reach_m;
  const double side = options_.right ? -1.0 : 1.0;
  const auto consider = [&](const Eigen::Vector2d& point_m) {
    const double range_m = point_m.norm(), bearing_rad = side * std::atan2(point_m.y(), point_m.x());
    if (range_m >= least_m || bearing_rad > kBehind_rad || bearing_rad < -kAhead_rad) return;
    least_m = range_m;
    best = point_m;
  };
  for (const Eigen::Vector2d& point_m : boundary.points_m) consider(point_m);
  for (const Barriers::Solid& solid : boundary.solids) {
    for (std::size_t i = 0; i < solid.outline_m.size(); ++i) {
      const Eigen::Vector2d& a = solid.outline_m[i];
      const Eigen::Vector2d way = solid.outline_m[(i + 1) % solid.outline_m.size()] - a;
      const int samples = 1 + static_cast<int>(way.norm() / kSampleM);
      for (int k = 0; k < samples; ++k) consider(a + way * k / samples);
    }
  }
  return best;
}

BoundaryLaw::Result BoundaryLaw::follow(const Barriers& boundary, double distance_m) const {
  Result result;
  const double side = options_.right ? -1.0 : 1.0;
  result.clear = isClear(boundary);
  result.turn = -side;
  const auto point_m = nearest(boundary);
  if (!point_m) return result;
  result.follows = true;
  result.distance_m = point_m->norm();
  const double bearing_rad = std::atan2(point_m->y(), point_m->x());
  const double approach_rad = std::clamp(std::atan(options_.gain_per_m * (result.distance_m - distance_m)),
                                         -kSteepest_rad, kSteepest_rad);
  result.heading_rad = wrapAngle(bearing_rad - side * (M_PI_2 - approach_rad));
  return result;
}

}  // namespace omnifleet::motion
