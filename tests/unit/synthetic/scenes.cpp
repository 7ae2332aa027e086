#include "tests/unit/synthetic/scenes.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::synthetic::test {
namespace {

/// Distances along the ray at which it enters and leaves a solid; enter > leave: no hit.
struct Span {
  double enter = 0.0, leave = INFINITY;
};

void cut(Span& span, double from, double along, double low, double high) {
  if (std::abs(along) < 1e-15) {
    if (from < low || from > high) span.leave = -1.0;
    return;
  }
  const double a = (low - from) / along, b = (high - from) / along;
  span.enter = std::max(span.enter, std::min(a, b));
  span.leave = std::min(span.leave, std::max(a, b));
}

Span spanOf(const Solid& solid, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  const Pose2 solid_from_map = solid.map_from_solid.inverse();
  const Eigen::Vector2d origin = solid_from_map * Eigen::Vector2d(from.head<2>());
  const Eigen::Vector2d way = solid_from_map.rotation() * ray.head<2>();
  Span span;
  cut(span, from.z(), ray.z(), 0.0, solid.height_m);
  if (solid.kind == SolidKind::kBox) {
    for (int axis = 0; axis < 2; ++axis) {
      cut(span, origin[axis], way[axis], -0.5 * solid.size_m[axis], 0.5 * solid.size_m[axis]);
    }
    return span;
  }
  const double a = way.squaredNorm(), b = origin.dot(way),
               c = origin.squaredNorm() - solid.radius_m * solid.radius_m;
  const double root = b * b - a * c;
  if (root < 0.0 || a < 1e-18) return c < 0.0 ? span : Span{1.0, 0.0};
  span.enter = std::max(span.enter, (-b - std::sqrt(root)) / a);
  span.leave = std::min(span.leave, (-b + std::sqrt(root)) / a);
  return span;
}

}  // namespace

Arena plainArena() {
  Arena arena;
  arena.name = "plain";
  arena.floor.rgb = {200, 200, 200};
  arena.floor.clouds = 0.0;
  arena.floor.texture = 0.0;
  arena.light.ambient = 1.0;
  arena.image.noise = 0.0;
  arena.image.shot_noise = 0.0;
  return arena;
}

lens::CameraModel smallFisheye() {
  lens::CameraModel model;
  model.projection = lens::Projection::kEquidistant;
  model.image_width_px = 320;
  model.image_height_px = 240;
  model.principal_point_px = {160.3, 119.2};
  model.fov_deg = 185.0;
  model.focal_px = Eigen::Vector2d::Constant(118.0 / (92.5 * M_PI / 180.0));
  model.position_m = {0.0, 0.0, 0.5};
  return model;
}

lens::CameraModel ceilingPinhole(double height_m) {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 320;
  model.image_height_px = 240;
  model.principal_point_px = {159.5, 119.5};
  model.focal_px = {220.0, 220.0};
  model.position_m = {0.1, -0.2, height_m};
  return model;
}

void hangCamera(Arena& arena, const lens::CameraModel& model) {
  arena.cameras.push_back({"ceiling/c", "", model});
}

void addRobot(Arena& arena, const std::string& name, const Pose2& pose, const lens::CameraModel& model) {
  ArenaRobot robot;
  robot.name = name;
  robot.initial_map_from_base = pose;
  robot.body.radius_m = 0.15;
  robot.body.height_m = 0.30;
  robot.body.wheel_separation_m = 0.26;
  robot.texture = 0.0;
  arena.robots.push_back(robot);
  arena.cameras.push_back({name + "/fisheye", name, model});
}

int firstSolid(const std::vector<Solid>& solids, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  int first = -1;
  double nearest = INFINITY;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const Span span = spanOf(solids[i], from, ray);
    if (span.enter > span.leave || span.enter >= nearest) continue;
    nearest = span.enter;
    first = static_cast<int>(i);
  }
  return first;
}

double trueCoverage(const std::vector<Solid>& solids, const lens::Camera& camera,
                    const Pose2& map_from_parent, int u, int v, int samples) {
  const Eigen::Vector3d eye = camera.model().position_m;
  const Eigen::Vector2d foot = map_from_parent * Eigen::Vector2d(eye.head<2>());
  const Eigen::Vector3d from(foot.x(), foot.y(), eye.z());
  int covered = 0, seen = 0;
  for (int a = 0; a < samples; ++a) {
    for (int b = 0; b < samples; ++b) {
      const auto ray = camera.rayFromPixel({u + (a + 0.5) / samples - 0.5, v + (b + 0.5) / samples - 0.5});
      if (!ray) continue;
      const Eigen::Vector2d flat = map_from_parent.rotation() * ray->head<2>();
      ++seen;
      if (firstSolid(solids, from, {flat.x(), flat.y(), ray->z()}) >= 0) ++covered;
    }
  }
  return seen ? static_cast<double>(covered) / seen : 0.0;
}

}  // namespace omnifleet::synthetic::test
