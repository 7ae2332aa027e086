#include "laser/join.h"

#include <cmath>
#include <limits>
#include <vector>

namespace omnifleet::laser {
namespace {

constexpr double kSameObject_m = 0.15;

/// Nearest echo per ray of the camera: range about the camera's foot, and index of the laser's ray.
struct Nearest {
  double range_m = std::numeric_limits<double>::infinity();
  std::size_t ray = 0;
};

bool isEcho(RayLabel label) {
  return label == RayLabel::kUnknown || label == RayLabel::kObstacle;
}

}  // namespace

void join(const LocalMap& by_laser, Scan& camera) {
  const Scan& laser = by_laser.scan;
  const std::size_t rays = camera.range_m.size(), echoes = laser.range_m.size();
  if (by_laser.state != FrameState::kOk || rays == 0) return;
  std::vector<Nearest> nearest(rays);
  for (std::size_t i = 0; i < echoes; ++i) {
    if (!isEcho(laser.label[i])) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(echoes);
    const Eigen::Vector2d from_foot =
        laser.origin_m - camera.origin_m +
        laser.range_m[i] * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
    const double turns = std::atan2(from_foot.y(), from_foot.x()) / (2.0 * M_PI) + 1.0;
    Nearest& at = nearest[static_cast<std::size_t>(std::lround(turns * static_cast<double>(rays))) % rays];
    if (from_foot.norm() < at.range_m) at = {from_foot.norm(), i};
  }
  for (std::size_t i = 0; i < rays; ++i) {
    const Nearest& at = nearest[i];
    if (!std::isfinite(at.range_m)) continue;
    const bool saw_floor = camera.label[i] == RayLabel::kFloorEnd || camera.label[i] == RayLabel::kInvalid ||
                           camera.label[i] == RayLabel::kUndecided;
    const bool same_object = !saw_floor && std::abs(camera.range_m[i] - at.range_m) < kSameObject_m;
    // An object below the laser's plane: the camera sees it, the laser passes over it.
    if (!saw_floor && !same_object && camera.range_m[i] < at.range_m) continue;
    camera.range_m[i] = static_cast<float>(at.range_m);
    camera.sigma_m[i] = laser.sigma_m[at.ray];
    if (same_object) continue;
    camera.label[i] = laser.label[at.ray];
    camera.object[i] = 0;
  }
}

}  // namespace omnifleet::laser
