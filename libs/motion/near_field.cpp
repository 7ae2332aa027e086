#include "motion/near_field.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

// Contours cut by the edge of the visible floor follow it up to this distance (m). They are not the boundary
// of an obstacle.
constexpr double kCutM = 0.015;
constexpr double kReachM = 0.5;  // m beyond the edge; no robot moves farther between two frames
constexpr double kSameM = 0.01;  // m, nearer points are treated as one

template <typename Gone>
void eraseIf(std::vector<Eigen::Vector2d>& points_m, Gone gone) {
  points_m.erase(std::remove_if(points_m.begin(), points_m.end(), gone), points_m.end());
}

}  // namespace

void NearField::moved(const Pose2& previous_from_current) {
  const Pose2 current_from_previous = previous_from_current.inverse();
  for (Eigen::Vector2d& point_m : seen_m_) point_m = current_from_previous * point_m;
  for (Eigen::Vector2d& point_m : hidden_m_) point_m = current_from_previous * point_m;
}

void NearField::see(const Scan& scan) {
  const double edge_m = scan.blind_m > 0.0 ? scan.blind_m + kCutM : 0.0;
  const auto isHidden = [&](const Eigen::Vector2d& point_m) {
    return (point_m - scan.origin_m).squaredNorm() < edge_m * edge_m;
  };
  eraseIf(hidden_m_, [&](const Eigen::Vector2d& point_m) { return !isHidden(point_m); });
  for (const Eigen::Vector2d& point_m : seen_m_) {
    if (isHidden(point_m) && !isKnown(point_m)) hidden_m_.push_back(point_m);
  }
  seen_m_.clear();
  if (edge_m <= 0.0) return;
  const double step_rad = 2.0 * M_PI / static_cast<double>(std::max<std::size_t>(1, scan.range_m.size()));
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const bool solid = isSolid(scan.label[i]);
    const double range_m = scan.range_m[i], bearing_rad = step_rad * static_cast<double>(i);
    if (!solid || !(range_m >= edge_m && range_m < edge_m + kReachM)) continue;
    seen_m_.push_back(scan.origin_m +
                      range_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad)));
  }
}

void NearField::clear(const Eigen::Vector2d& place_m, double radius_m) {
  const auto there = [&](const Eigen::Vector2d& point_m) { return (point_m - place_m).norm() < radius_m; };
  eraseIf(seen_m_, there);
  eraseIf(hidden_m_, there);
}

bool NearField::isKnown(const Eigen::Vector2d& point_m) const {
  return std::any_of(hidden_m_.begin(), hidden_m_.end(), [&](const Eigen::Vector2d& known_m) {
    return (known_m - point_m).squaredNorm() < kSameM * kSameM;
  });
}

}  // namespace omnifleet::motion
